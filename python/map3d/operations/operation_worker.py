"""The operation worker: leases operations and runs each in a subprocess, so that a crash fails only that operation."""

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any, Final

from map3d import errors
from map3d.catalogue import Catalogue, OperationLease, OperationRecord, OperationState, Workspace
from map3d.errors import Map3dError, NotFound, StaleFence, StoreError
from map3d.jobs.dead_workers import expire_dead_workers, process_of, worker_name
from map3d.jobs.stop_request import StopRequest
from map3d.messages import Message, load_message, message
from map3d.operations.do_operation import request_of
from map3d.operations.operation_report import STARTING
from map3d.operations.uploaded_files import remove_staging, remove_upload
from map3d.process_identity import ProcessIdentity
from map3d.subprocess import Failure, Subprocess

ENTRY: Final = "map3d.operations.do_operation:open_operation"
START_S: Final = 60.0
HEARTBEAT_S: Final = 1.0
"""How often a worker reports progress and hears of a cancellation."""
POLL_S: Final = 1.0
"""How often an idle worker asks for operations."""

OnOperation = Callable[[str], None]
"""Called with a line about each operation that begins or ends."""


class _Interrupted(Exception):
    """The subprocess has to stop: the operation was cancelled, its lease was lost, or the worker stops."""


class _Cancelled(_Interrupted):
    pass


@dataclass
class OperationWorker:
    """Does operations one after another. `poll_s`: how often it asks for one when there is none; `entry`: function that opens the subprocess."""

    workspace: Workspace
    catalogue: Catalogue
    on_operation: OnOperation = lambda _: None
    poll_s: float = POLL_S
    heartbeat_s: float = HEARTBEAT_S
    entry: str = ENTRY

    def __post_init__(self) -> None:
        self.stop = StopRequest()
        self._name = worker_name(0)

    def run(self, *, forever: bool = True) -> int:
        """Does operations until SIGINT or SIGTERM, which releases the current one; without `forever`, until none waits, also behind one that another
        worker does. Returns the number of operations that ended. Waits while the catalogue cannot be reached."""
        ended, has_failed = 0, False
        with self.stop.on_signals():
            while not self.stop.is_made:
                lease = None
                try:
                    expire_dead_operations(self.catalogue, [self._name] if has_failed else [])
                    has_failed = False
                    lease = self.catalogue.lease_operation(self._name)
                    if lease is not None:
                        ended += self._do(lease)
                    elif not forever and not self.catalogue.operations(states=[OperationState.WAITING], limit=1):
                        break
                except (StoreError, StaleFence) as error:
                    self.on_operation(f"trying again soon: {error}")
                    lease, has_failed = None, True
                if lease is None:
                    self._sleep(self.poll_s)
        return ended

    def _do(self, lease: OperationLease) -> bool:
        """Does an operation; returns whether it ended."""
        operation = lease.operation
        name = f"operation {operation.id} ({operation.kind} {operation.target})"
        self.on_operation(f"{name} begins")
        keeper = _LeaseKeeper(self.catalogue, lease, self.stop, self.heartbeat_s)
        try:
            ended = self._run_subprocess(lease, keeper)
            keeper.complete()
            state = OperationState.DONE
        except _Cancelled:
            ended, state = message("cancelled-while", stage=keeper.stage), OperationState.CANCELLED
        except _Interrupted:
            self._clean_up(lease)
            if self.stop.is_made:
                self.catalogue.release_operation(lease)
            self.on_operation(f"{name} is released")
            return False
        except Map3dError as error:
            if isinstance(error, StoreError | StaleFence):
                raise
            ended, state = error.message, OperationState.FAILED
        self._clean_up(lease)
        self.catalogue.append_log(lease, [ended if state is OperationState.CANCELLED else message(f"operation-{state}", message=ended)])
        self.catalogue.end_operation(lease, state, ended)
        if state is OperationState.DONE and operation.kind == "import":
            self._remove_uploads(operation)
        self.on_operation(f"{name} is {state}: {ended}")
        return True

    def _run_subprocess(self, lease: OperationLease, keeper: "_LeaseKeeper") -> Message:
        """Returns the message of the operation's end. Raises the error with which it failed."""
        keeper.beat()
        setup = {"workspace": str(self.workspace.root.absolute()), "catalogue": self.workspace.catalogue_url}
        process = Subprocess(self.entry, setup)
        try:
            process.wait_ready(START_S)
            answer = process.request(request_of(lease.operation), wall_s=None, every_s=self.heartbeat_s / 4, on_progress=keeper.on_progress)
        finally:
            process.close()
        if isinstance(answer, Failure):
            raise _error(answer)
        return load_message(answer.value["message"])

    def _remove_uploads(self, operation: OperationRecord) -> None:
        """Removes the uploads of an import whose end is stored: before that, a repetition needs them."""
        for id in operation.arguments.get("files", ()):
            remove_upload(self.workspace, id, operation.asked_by)

    def _clean_up(self, lease: OperationLease) -> None:
        """Removes what a killed subprocess left: arranged uploads, and leases of jobs that would keep others waiting."""
        remove_staging(self.workspace, lease.operation.id)
        for record in self.catalogue.renderings():
            if record.scene == lease.operation.scene:
                expire_dead_workers(self.catalogue, record.name)

    def _sleep(self, seconds: float) -> None:
        """Ends early when the worker stops."""
        end = time.monotonic() + seconds
        while not self.stop.is_made and (left := end - time.monotonic()) > 0:
            time.sleep(min(left, 0.1))


class _LeaseKeeper:
    """Renews the lease with the operation's progress; raises _Cancelled or _Interrupted when the subprocess has to stop."""

    def __init__(self, catalogue: Catalogue, lease: OperationLease, stop: StopRequest, every_s: float) -> None:
        self._catalogue, self._lease, self._stop, self._every_s = catalogue, lease, stop, every_s
        self.stage, self._done, self._total = STARTING, 0, 0
        self._beat_s = 0.0

    def on_progress(self, progress: dict[str, Any] | None) -> None:
        is_new = False
        if progress is not None:
            stage = load_message(progress["stage"])
            is_new = _subject(stage) != _subject(self.stage)
            self.stage, self._done, self._total = stage, progress["done"], progress["total"]
            if progress["lines"]:
                self._catalogue.append_log(self._lease, [load_message(line) for line in progress["lines"]])
        if self._stop.is_made:
            raise _Interrupted
        if is_new or time.monotonic() - self._beat_s >= self._every_s:
            self.beat()

    def store(self) -> bool:
        """Renews the lease and stores the progress; returns whether to continue."""
        self._beat_s = time.monotonic()
        return self._catalogue.heartbeat_operation(self._lease, self.stage, self._done, self._total)

    def complete(self) -> None:
        """Stores that all steps are done."""
        self._done = self._total
        self.store()

    def beat(self) -> None:
        if not self.store():
            cancelling = self._catalogue.operation(self._lease.operation.id).cancelling
            raise _Cancelled if cancelling else _Interrupted


def _subject(stage: Message) -> str:
    """Returns what the work is about: a file, or the stage itself."""
    return str(stage.values.get("file", stage.code))


def expire_dead_operations(catalogue: Catalogue, dropped: Collection[str] = ()) -> int:
    """Expires the leases of operation workers whose process was on this host and has ended; returns their number. `dropped`: workers that do nothing,
    although their process runs."""
    running = [item.worker for item in catalogue.operations(states=[OperationState.RUNNING], limit=1000) if item.worker is not None]
    return catalogue.expire_operations([worker for worker in running if worker in dropped or _has_ended(worker)])


def _has_ended(worker: str) -> bool:
    identity = ProcessIdentity.parse(process_of(worker))
    return identity is not None and identity.has_ended()


def _error(failure: Failure) -> Map3dError:
    """Returns the error that the subprocess reported; its own failure to reach the catalogue fails the operation too."""
    kind = getattr(errors, failure.kind, None)
    if isinstance(kind, type) and issubclass(kind, Map3dError):
        return kind(failure.message) if not issubclass(kind, StoreError | StaleFence | NotFound) else Map3dError(failure.message)
    known = failure.kind in ("FormatError", "StorageError", "LimitError")
    return Map3dError(failure.message if known else f"{failure.kind}: {failure.message} (this is a bug in map3d; see the log of the worker)")
