"""The subprocess of an operation: does one operation, with the functions that the command line uses too."""

from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from map3d.catalogue import Catalogue, OperationRecord, OperationState, Workspace
from map3d.messages import Message
from map3d.operations.do_import import do_build, do_import
from map3d.operations.do_removal import do_removal
from map3d.operations.do_render import do_publish, do_render
from map3d.operations.operation_report import OperationReport
from map3d.subprocess import Handler

DO: Final[Mapping[str, Callable[[Workspace, Catalogue, OperationRecord, OperationReport], Message]]] = {
    "import": do_import,
    "build": do_build,
    "render": do_render,
    "publish": do_publish,
    "remove": do_removal,
}
"""Operation kind → function that does it and returns the message with which it ends."""


def request_of(operation: OperationRecord) -> dict[str, Any]:
    """Returns the operation as JSON for the subprocess."""
    names = ("id", "kind", "target", "scene", "arguments", "asked_by")
    return {name: getattr(operation, name) for name in names} | {"created": operation.created.isoformat()}


def open_operation(setup: dict[str, Any]) -> Handler:
    """Returns the handler that does an operation. `setup`: folder and catalogue of the workspace."""
    workspace = Workspace(Path(setup["workspace"]), setup["catalogue"])

    def handle(request: dict[str, Any], _blobs: list[bytes], send: Callable[[Any], None]) -> tuple[dict[str, Any], Sequence[bytes]]:
        operation, report = _load(request), OperationReport(send)
        with workspace.open_catalogue() as catalogue:
            try:
                return {"message": DO[operation.kind](workspace, catalogue, operation, report).document}, []
            finally:
                report.flush()

    return handle


def _load(request: Mapping[str, Any]) -> OperationRecord:
    fields = {name: value for name, value in request.items() if name != "created"}
    created = datetime.fromisoformat(request["created"])
    return OperationRecord(**fields, state=OperationState.RUNNING, stage=None, done=0, total=0, message=None, created=created)
