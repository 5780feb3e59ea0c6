"""The settings of workers."""

from dataclasses import dataclass, field
from typing import Final

from map3d.errors import BadRequest
from map3d.jobs.timeouts import Timeouts
from map3d.quantities import plural
from map3d.renderings.render_task import CACHE_BYTES, RENDER_ENTRY

MIN_CACHE_BYTES: Final = 64 << 20
WORKER_BYTES: Final = 256 << 20
"""Memory of a subprocess without its cache: interpreter, libraries, G-buffers of one block."""


@dataclass(frozen=True)
class RunSettings:
    """`max_memory_bytes`: for all workers together; None selects the default cache size."""

    workers: int
    max_memory_bytes: int | None = None
    timeouts: Timeouts = field(default_factory=Timeouts)
    entry: str = RENDER_ENTRY

    def check(self) -> None:
        """Raises BadRequest when the memory is too small for the workers."""
        _ = self.cache_bytes

    @property
    def cache_bytes(self) -> int:
        """Cache size of one subprocess. Raises BadRequest when the memory is too small for the workers."""
        if self.max_memory_bytes is None:
            return CACHE_BYTES
        each = self.max_memory_bytes // self.workers - WORKER_BYTES
        if each < MIN_CACHE_BYTES:
            need = self.workers * (MIN_CACHE_BYTES + WORKER_BYTES)
            raise BadRequest(
                f"--max-memory {self.max_memory_bytes >> 20} MiB is too small for {plural(self.workers, 'worker')}: "
                f"give at least {need >> 20} MiB, or fewer --workers"
            )
        return each
