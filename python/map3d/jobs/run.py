"""`map3d render`: plans the jobs, runs the workers, writes the manifest."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from map3d.catalogue import Catalogue, PlanCounts, RenderingRecord, State, Workspace
from map3d.catalogue.scene_lock import scene_lock
from map3d.errors import BadRequest, StalePlan
from map3d.jobs.events import RunEvent
from map3d.jobs.pool import Pool, RunStatistics
from map3d.jobs.timeouts import Timeouts
from map3d.renderings.build import open_scene
from map3d.renderings.manifest_writer import Planned, write_manifest
from map3d.renderings.plan import PlannedScene, plan_jobs, planned_occupancy
from map3d.renderings.render_task import CACHE_BYTES, RENDER_ENTRY, RenderTask
from map3d.renderings.track_stores import find_track
from map3d.tiles.naming import block_levels
from map3d.tiles.occupancy import Numbers, Occupancy, numbers_of
from map3d.types import Box

MAX_PLANS: Final = 10
"""A run whose scene was rebuilt this often ends."""
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

    @property
    def cache_bytes(self) -> int:
        """Cache size of one subprocess. Raises BadRequest when the memory is too small for the workers."""
        if self.max_memory_bytes is None:
            return CACHE_BYTES
        each = self.max_memory_bytes // self.workers - WORKER_BYTES
        if each < MIN_CACHE_BYTES:
            need = self.workers * (MIN_CACHE_BYTES + WORKER_BYTES)
            raise BadRequest(
                f"--max-memory {self.max_memory_bytes >> 20} MiB is too small for {self.workers} workers: "
                f"give at least {need >> 20} MiB, or fewer --workers"
            )
        return each


@dataclass(frozen=True)
class RunPlan:
    """The planned work: counts of jobs, and the base tiles that open blocks of the first pass may fill."""

    counts: PlanCounts
    open_jobs: int
    done_jobs: int
    quarantined_jobs: int
    box: Box
    occupancy: Planned


@dataclass(frozen=True)
class RunResult:
    """How a run ended. `complete`: every job is done; `stats`: the sums of `RenderTask.stats`, empty when there were no jobs to do."""

    statistics: RunStatistics
    complete: bool
    stopped: bool
    open_jobs: int
    quarantined_jobs: int
    content_version: int
    stats: Mapping[str, float] = field(default_factory=dict)


class Run:
    """One run of a rendering whose scene is built; the steps are separate so that the caller can show progress."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue, rendering: str, settings: RunSettings) -> None:
        self._workspace, self._catalogue, self._settings = workspace, catalogue, settings
        self.record = catalogue.rendering(rendering)
        self._cache_bytes = settings.cache_bytes
        self._pool: Pool | None = None

    def plan(self, progress: Callable[[int, int], None] | None = None, scene: PlannedScene | None = None) -> RunPlan:
        """Compares the scene with the stored blocks, opens jobs for new and changed blocks, and announces them in the manifest."""
        self.record = self._catalogue.rendering(self.record.name)
        blocks = _planned_blocks(self._catalogue, self.record)
        with scene_lock(self._workspace, self.record.scene):
            opened = scene or open_scene(self._workspace, self.record.scene)
            planned = self._catalogue.plan(self.record.name, plan_jobs(opened, self.record, blocks, progress))
        self.record = self._catalogue.rendering(self.record.name)
        self._prune()
        counts = self._catalogue.count_jobs(self.record.name)
        occupancy = self._open_occupancy(opened) if counts[State.DONE] < sum(counts.values()) else {}
        box = opened.box
        if occupancy or planned.added or not self._workspace.manifest_path(self.record.name).is_file():
            write_manifest(self._workspace, self._catalogue, self.record.name, box, occupancy)
        open_jobs = counts[State.WAITING] + counts[State.TODO] + counts[State.LEASED]
        return RunPlan(planned, open_jobs, counts[State.DONE], counts[State.QUARANTINED], box, occupancy)

    def work(self, plan: RunPlan, on_event: Callable[[RunEvent], None]) -> RunResult:
        """Runs the workers until no jobs are left or the user stops them, then writes the manifest. Plans again when the scene is rebuilt meanwhile;
        raises StalePlan when that happens too often."""
        if not plan.open_jobs:
            return self._finish(plan, RunStatistics(), False)
        statistics, stats = RunStatistics(), Counter[str]()
        for _ in range(MAX_PLANS):
            pool = self._run_pool(statistics, stats, on_event)
            if pool.stopped or not pool.scene_changed:
                return self._finish(plan, statistics, pool.stopped, dict(stats))
            plan = self.plan()
        raise StalePlan(f"rendering {self.record.name}: its files changed {MAX_PLANS} times during the render; run it again when they stay the same")

    def _run_pool(self, statistics: RunStatistics, stats: Counter[str], on_event: Callable[[RunEvent], None]) -> Pool:
        task = RenderTask(self._workspace, self.record, cache_bytes=self._cache_bytes, entry=self._settings.entry)
        self._pool = Pool(self._catalogue, self.record.name, task, self._settings.workers, self._settings.timeouts)
        self._pool.statistics = statistics
        try:
            self._pool.run(on_event)
        finally:
            task.close()
            stats.update(task.stats)
        return self._pool

    def stop(self) -> None:
        """Makes the workers finish their current blocks and exit."""
        if self._pool is not None:
            self._pool.stop()

    def _finish(self, plan: RunPlan, statistics: RunStatistics, stopped: bool, stats: Mapping[str, float] | None = None) -> RunResult:
        counts = self._catalogue.count_jobs(self.record.name)
        complete = counts[State.DONE] == sum(counts.values())
        write_manifest(self._workspace, self._catalogue, self.record.name, plan.box, {} if complete else self._within_open(plan.occupancy))
        open_jobs = counts[State.WAITING] + counts[State.TODO] + counts[State.LEASED]
        return RunResult(statistics, complete, stopped, open_jobs, counts[State.QUARANTINED], self.record.content_version, stats or {})

    def _prune(self) -> None:
        """Removes stored blocks without a job, such as those of earlier frames."""
        for track in self.record.tracks:
            if (found := find_track(self._workspace, self.record, track.id, read_only=False)) is not None:
                jobs = {job.block for job in self._catalogue.jobs(self.record.name, track.id)}
                with found as store:
                    for block in store.list_blocks():
                        if block.id not in jobs:
                            store.remove_block(block.id)

    def _open_occupancy(self, scene: PlannedScene) -> dict[str, Occupancy]:
        """Returns, for each view, the base tiles that open blocks of its first pass may fill; later passes fill the same tiles as the first."""
        return {frame.id: planned_occupancy(scene, frame, within=self._open_blocks(frame.id)) for frame in self.record.frames}

    def _open_blocks(self, view: str) -> Numbers:
        """Returns the base blocks of the view's first pass that are not done."""
        jobs = self._catalogue.jobs(self.record.name, view)
        return numbers_of((job.block.x, job.block.y) for job in jobs if job.kind == "base" and job.state is not State.DONE)

    def _within_open(self, planned: Planned) -> dict[str, Occupancy]:
        """Restricts each view's occupancy to base blocks that are not done now."""
        root = block_levels(self.record.zmax)[0].root
        remaining = {}
        for view, occupancy in planned.items():
            base = occupancy.numbers(self.record.zmax)
            above = base >> np.uint64(2 * (self.record.zmax - root))
            remaining[view] = Occupancy(self.record.zmax, base[np.isin(above, self._open_blocks(view))])
        return remaining


def _planned_blocks(catalogue: Catalogue, record: RenderingRecord) -> dict[str, Numbers]:
    """Returns the base blocks with a job, by track."""
    jobs = {track.id: catalogue.jobs(record.name, track.id) for track in record.tracks}
    return {track: numbers_of((job.block.x, job.block.y) for job in own if job.kind == "base") for track, own in jobs.items()}
