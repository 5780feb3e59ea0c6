"""The contract of catalogues for operations (spec/catalogue.md). tests/catalogue checks every implementation."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

from map3d.catalogue.operation_records import LogLine, OperationLease, OperationRecord, OperationState
from map3d.messages import Message

LOG_PAGE = 1_000


class OperationCatalogue(Protocol):
    """Two operations of one scene never run at the same time; the oldest waiting operation comes first."""

    def create_operation(self, kind: str, target: str, arguments: Mapping[str, Any], asked_by: str) -> OperationRecord:
        """Stores a waiting operation, and removes the oldest of more than `MAX_ENDED` ended ones. Raises NotFound when the target does not exist,
        BadRequest for an unknown kind or arguments that are not JSON."""

    def operation(self, id: str) -> OperationRecord:
        """Raises NotFound."""

    def operations(
        self,
        target: str | None = None,
        states: Sequence[OperationState] | None = None,
        limit: int = 100,
        *,
        scene: str | None = None,
        before: str | None = None,
    ) -> list[OperationRecord]:
        """Returns the newest operations first. `scene`: those of the scene and its renderings; `before`: those older than this id."""

    def lease_operation(self, worker: str) -> OperationLease | None:
        """Leases the oldest waiting operation of a scene that has no running one, after expiring overdue leases; None when there is none."""

    def heartbeat_operation(self, lease: OperationLease, stage: Message, done: int, total: int) -> bool:
        """Renews the lease and stores the progress. Returns False when the operation was cancelled or the lease is no longer held: the worker then
        stops the work; it ends a cancelled operation with `end_operation`."""

    def append_log(self, lease: OperationLease, lines: Sequence[Message]) -> None:
        """Adds lines to the log, which keeps the first and the latest MAX_LOG_LINES / 2 lines. Raises StaleFence."""

    def operation_log(self, id: str, after: int = 0, limit: int = LOG_PAGE) -> list[LogLine]:
        """Returns the lines after number `after`, in order; a line with the missing number says how many lines are not kept. Raises NotFound."""

    def end_operation(self, lease: OperationLease, state: OperationState, message: Message | None = None) -> None:
        """Ends the operation as done, failed or cancelled; may be repeated. Raises StaleFence when the lease is no longer held."""

    def release_operation(self, lease: OperationLease) -> None:
        """Makes the operation wait again, for a worker that stops before it has ended. A cancelled operation ends. Raises StaleFence."""

    def expire_operations(self, workers: Iterable[str]) -> int:
        """Expires the leases of workers that no longer run, before their time; returns their number. After MAX_EXPIRIES the operation fails."""

    def cancel_operation(self, id: str) -> OperationRecord:
        """Cancels a waiting operation; tells the worker of a running one to stop it. Raises NotFound, BadRequest when it has ended."""

    def retry_operation(self, id: str) -> OperationRecord:
        """Makes a failed or cancelled operation wait again; its log stays. Raises NotFound, BadRequest in any other state."""
