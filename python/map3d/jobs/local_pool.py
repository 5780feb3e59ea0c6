"""Runs the workers of this process for a rendering."""

from collections import Counter
from collections.abc import Callable
from typing import Protocol

from map3d.catalogue import Catalogue, RenderingRecord, Workspace
from map3d.jobs.events import RunEvent
from map3d.jobs.pool import Pool
from map3d.jobs.run_settings import RunSettings
from map3d.jobs.run_statistics import RunStatistics
from map3d.jobs.stop_request import StopRequest
from map3d.renderings.render_task import RenderTask

OnEvent = Callable[[RunEvent], None]


class PoolRunner(Protocol):
    """Has workers do the jobs of a rendering until none are left, the user stops them, or the scene has changed; returns whether it has changed. Adds
    to `statistics` and to `stats`, the sums of the statistics of all committed blocks."""

    def __call__(self, record: RenderingRecord, statistics: RunStatistics, stats: Counter[str], stop: StopRequest, on_event: OnEvent) -> bool: ...


class LocalPools:
    """Implements `PoolRunner` with threads and subprocesses of this process."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue, settings: RunSettings) -> None:
        """Raises BadRequest when the memory is too small for the workers."""
        self._workspace, self._catalogue, self._settings = workspace, catalogue, settings
        self._cache_bytes = settings.cache_bytes

    def __call__(self, record: RenderingRecord, statistics: RunStatistics, stats: Counter[str], stop: StopRequest, on_event: OnEvent) -> bool:
        task = RenderTask(
            self._workspace,
            record,
            cache_bytes=self._cache_bytes,
            entry=self._settings.entry,
            scene=self._catalogue.scene(record.scene),
        )
        pool = Pool(self._catalogue, record.name, task, self._settings.workers, self._settings.timeouts, stop)
        pool.statistics = statistics
        try:
            pool.run(on_event)
        finally:
            task.close()
            stats.update(task.stats)
        return pool.scene_changed
