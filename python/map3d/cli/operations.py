"""map3d operations, a group of commands; without one, it lists operations."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import click

from map3d.catalogue import Catalogue, LogLine, OperationRecord, Workspace
from map3d.cli.options import json_option, workspace_option
from map3d.cli.ordered_group import OrderedGroup
from map3d.cli.output import print_json, print_table

Act = Callable[[Catalogue, str], tuple[Any, Sequence[str]]]
"""Takes an operation's id and returns the document of `--json` and the lines of text that stand in its place."""


@click.group("operations", cls=OrderedGroup, invoke_without_command=True)
@click.option("--target", help="Only operations on this scene or rendering.")
@click.option("--limit", type=click.IntRange(1, 10_000), default=20, show_default=True, help="Number of operations to list.")
@json_option
@workspace_option
@click.pass_context
def command(context: click.Context, workspace: Workspace, target: str | None, limit: int, as_json: bool) -> None:
    """List operations, newest first: imports, builds, renders, publications and removals that were asked for in the web interface or by programs.

    map3d serve does them, or map3d work --operations.
    """
    if context.invoked_subcommand is not None:
        return
    with workspace.open_catalogue() as catalogue:
        found = catalogue.operations(target, limit=limit)
    if as_json:
        print_json(found)
        return
    rows = [
        (item.id, item.kind, item.target, _state_text(item), _progress_text(item), item.asked_by, f"{item.created:%Y-%m-%d %H:%M}") for item in found
    ]
    print_table(("id", "kind", "target", "state", "progress", "asked by", "created (UTC)"), rows)


def about_one(act: Act) -> click.Command:
    """Makes a command about one operation of a function, whose name is the command's and whose docstring is the help."""

    @command.command(act.__name__, help=act.__doc__)
    @click.argument("id")
    @json_option
    @workspace_option
    def about(workspace: Workspace, id: str, as_json: bool) -> None:
        with workspace.open_catalogue() as catalogue:
            document, lines = act(catalogue, id)
        if as_json:
            print_json(document)
        else:
            click.echo("\n".join(lines))

    return about


@about_one
def show(catalogue: Catalogue, id: str) -> tuple[dict[str, Any], list[str]]:
    """Show an operation and its log."""
    operation, log = catalogue.operation(id), list(_log(catalogue, id))
    return {"operation": operation, "log": log}, [*_head(operation), *(f"{line.time:%H:%M:%S}  {line.text}" for line in log)]


@about_one
def cancel(catalogue: Catalogue, id: str) -> tuple[OperationRecord, list[str]]:
    """Cancel a waiting or running operation. A running one stops within seconds and can be retried."""
    operation = catalogue.cancel_operation(id)
    return operation, [f"operation {id}: {_state_text(operation)}"]


@about_one
def retry(catalogue: Catalogue, id: str) -> tuple[OperationRecord, list[str]]:
    """Retry a failed or cancelled operation; it resumes where it stopped."""
    return catalogue.retry_operation(id), [f"operation {id} waits for an operation worker: map3d serve, or map3d work --operations"]


def _log(catalogue: Catalogue, id: str) -> Iterator[LogLine]:
    after = 0
    while page := catalogue.operation_log(id, after):
        yield from page
        after = page[-1].number


def _head(operation: OperationRecord) -> list[str]:
    asked = f"asked for by {operation.asked_by} at {operation.created:%Y-%m-%d %H:%M} UTC"
    return [f"operation {operation.id}: {operation.kind} {operation.target}, {asked}", f"{_state_text(operation)}: {_progress_text(operation)}"]


def _state_text(operation: OperationRecord) -> str:
    return "cancelling" if operation.cancelling else operation.state


def _progress_text(operation: OperationRecord) -> str:
    """Returns the stage of a running operation, or the message with which it ended."""
    if operation.ended is not None or not operation.stage:
        return str(operation.message or "")
    counts = f" {operation.done:,} of {operation.total:,}" if operation.total else ""
    return f"{operation.stage}{counts}"
