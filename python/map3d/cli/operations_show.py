"""map3d operations show."""

from collections.abc import Iterator
from typing import Any

from map3d.catalogue import Catalogue, LogLine, OperationRecord
from map3d.cli.operation_command import operation_command
from map3d.cli.operations import progress_text, state_text


@operation_command("show")
def command(catalogue: Catalogue, id: str) -> tuple[dict[str, Any], list[str]]:
    """Show an operation and its log."""
    operation, log = catalogue.operation(id), list(_log(catalogue, id))
    return {"operation": operation, "log": log}, [*_head(operation), *(f"{line.time:%H:%M:%S}  {line.text}" for line in log)]


def _log(catalogue: Catalogue, id: str) -> Iterator[LogLine]:
    after = 0
    while page := catalogue.operation_log(id, after):
        yield from page
        after = page[-1].number


def _head(operation: OperationRecord) -> list[str]:
    asked = f"asked for by {operation.asked_by} at {operation.created:%Y-%m-%d %H:%M} UTC"
    return [f"operation {operation.id}: {operation.kind} {operation.target}, {asked}", f"{state_text(operation)}: {progress_text(operation)}"]
