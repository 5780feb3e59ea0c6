"""map3d operations retry."""

from map3d.catalogue import Catalogue, OperationRecord
from map3d.cli.operation_command import operation_command


@operation_command("retry")
def command(catalogue: Catalogue, id: str) -> tuple[OperationRecord, list[str]]:
    """Do a failed or cancelled operation again; it goes on where it ended."""
    return catalogue.retry_operation(id), [f"operation {id} waits for an operation worker: map3d serve, or map3d work --operations"]
