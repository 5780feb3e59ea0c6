"""map3d operations cancel."""

from map3d.catalogue import Catalogue, OperationRecord
from map3d.cli.operation_command import operation_command
from map3d.cli.operations import state_text


@operation_command("cancel")
def command(catalogue: Catalogue, id: str) -> tuple[OperationRecord, list[str]]:
    """Cancel a waiting or running operation. A running one stops within seconds and can be retried."""
    operation = catalogue.cancel_operation(id)
    return operation, [f"operation {id}: {state_text(operation)}"]
