"""map3d operations, a group of commands; without one, it lists operations."""

import click

from map3d.catalogue import OperationRecord, Workspace
from map3d.cli.lazy_group import LazyGroup
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json, print_table

MODULES = {"show": "operations_show", "cancel": "operations_cancel", "retry": "operations_retry"}


@click.group("operations", cls=LazyGroup, modules=MODULES, invoke_without_command=True)
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
    catalogue = workspace.open_catalogue()
    try:
        found = catalogue.operations(target, limit=limit)
    finally:
        catalogue.close()
    if as_json:
        print_json(found)
        return
    rows = [
        (item.id, item.kind, item.target, state_text(item), progress_text(item), item.asked_by, f"{item.created:%Y-%m-%d %H:%M}") for item in found
    ]
    print_table(("id", "kind", "target", "state", "progress", "asked by", "created (UTC)"), rows)


def state_text(operation: OperationRecord) -> str:
    return "cancelling" if operation.cancelling else operation.state


def progress_text(operation: OperationRecord) -> str:
    """Returns the stage of a running operation, or the message with which it ended."""
    if operation.ended is not None or not operation.stage:
        return operation.message
    counts = f" {operation.done:,} of {operation.total:,}" if operation.total else ""
    return f"{operation.stage}{counts}"
