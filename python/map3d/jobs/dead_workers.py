"""Names of workers, and the leases of workers whose process has ended."""

from collections.abc import Collection

from map3d.catalogue import Catalogue, State
from map3d.process_identity import ProcessIdentity


def worker_name(number: int) -> str:
    """Returns the name of a worker of this process."""
    return f"{ProcessIdentity.current()}.{number}"


def expire_dead_workers(catalogue: Catalogue, rendering: str) -> int:
    """Expires the leases of workers whose process was on this host and has ended, such as those of a killed run; returns their number. Leases
    held on other hosts expire normally."""
    workers = {job.worker for job in catalogue.jobs(rendering, state=State.LEASED) if job.worker is not None}
    return catalogue.expire(rendering, [worker for worker in workers if _has_ended(worker)])


def expire_workers_of(catalogue: Catalogue, rendering: str, processes: Collection[str]) -> int:
    """Expires the leases of workers of these processes, which are known to be lost; returns their number."""
    workers = {job.worker for job in catalogue.jobs(rendering, state=State.LEASED) if job.worker is not None}
    return catalogue.expire(rendering, [worker for worker in workers if process_of(worker) in processes])


def process_of(worker: str) -> str:
    """Returns the part of a worker's name that names its process."""
    return worker.rpartition(".")[0]


def _has_ended(worker: str) -> bool:
    identity = ProcessIdentity.parse(process_of(worker))
    return identity is not None and identity.has_ended()
