"""`map3d render`: plans the jobs, has workers do them, writes the manifest."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from map3d.catalogue import Catalogue, PlanCounts, State, Track, Workspace
from map3d.catalogue.scene_lock import scene_lock
from map3d.catalogue.states import OPEN
from map3d.errors import StalePlan
from map3d.jobs.events import Planned, RunEvent
from map3d.jobs.finish import PlannedOccupancy, finish
from map3d.jobs.local_pool import LocalPools, PoolRunner
from map3d.jobs.run_settings import RunSettings
from map3d.jobs.run_statistics import RunStatistics
from map3d.jobs.stop_request import StopRequest
from map3d.renderings.manifest_writer import write_manifest
from map3d.renderings.plan import PlannedBlocks, PlannedScene, plan_jobs
from map3d.scenes.build import open_scene
from map3d.scenes.scene_cache import scene_in_use
from map3d.tiles.naming import morton
from map3d.tiles.track_stores import find_track, tiles_url
from map3d.types import BlockId

MAX_PLANS: Final = 10
"""A run whose scene was rebuilt this often ends."""


@dataclass(frozen=True)
class RunPlan:
    """The planned work."""

    counts: PlanCounts
    open_jobs: int
    done_jobs: int
    quarantined_jobs: int
    expected: PlannedOccupancy


@dataclass(frozen=True)
class RunResult:
    """How a run ended. `complete`: every job is done; `stats`: the sums of the statistics of all committed blocks, empty when there were no jobs to
    do."""

    statistics: RunStatistics
    complete: bool
    stopped: bool
    open_jobs: int
    quarantined_jobs: int
    content_version: int
    stats: Mapping[str, float] = field(default_factory=dict)


class Run:
    """One run of a rendering whose scene is built; the steps are separate so that the caller can show progress. `stop` ends it early."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue, rendering: str, settings: RunSettings, run_pool: PoolRunner | None = None) -> None:
        self._workspace, self._catalogue = workspace, catalogue
        self._run_pool = run_pool or LocalPools(workspace, catalogue, settings)
        self.record = catalogue.rendering(rendering)
        self.stop = StopRequest()

    def plan(self, progress: Callable[[int, int], None] | None = None, scene: PlannedScene | None = None) -> RunPlan:
        """Compares the scene with the stored blocks, opens jobs for new and changed blocks, and announces them in the manifest."""
        with scene_in_use(self._workspace, self._catalogue.scene(self.record.scene)):
            return self._plan(progress, scene)

    def _plan(self, progress: Callable[[int, int], None] | None, scene: PlannedScene | None) -> RunPlan:
        self.record = self._catalogue.rendering(self.record.name)
        blocks = PlannedBlocks(self._catalogue, self.record)
        with scene_lock(self._workspace, self.record.scene):
            opened = scene or open_scene(self._workspace, self.record.scene)
            planned = self._catalogue.plan(self.record.name, plan_jobs(opened, self.record, blocks, progress))
        self.record = self._catalogue.rendering(self.record.name)
        if planned.added or tiles_url(self.record) is None:
            self._prune()
        counts = self._catalogue.count_jobs(self.record.name)
        expected = PlannedOccupancy.of_scene(self._catalogue, self.record, opened, is_complete=counts[State.DONE] == sum(counts.values()))
        if expected.occupancy or planned.added or not self._workspace.manifest_path(self.record.name).is_file():
            write_manifest(self._workspace, self._catalogue, self.record.name, expected.box, expected.occupancy)
        return RunPlan(planned, sum(counts[state] for state in OPEN), counts[State.DONE], counts[State.QUARANTINED], expected)

    def work(self, plan: RunPlan, on_event: Callable[[RunEvent], None]) -> RunResult:
        """Has workers do the jobs until none are left or the user stops them, then writes the manifest. Plans again when the scene is rebuilt
        meanwhile; raises StalePlan when that happens too often."""
        statistics, stats = RunStatistics(), Counter[str]()
        with self.stop.on_signals():
            for _ in range(MAX_PLANS):
                on_event(Planned(plan.counts, plan.open_jobs))
                changed = plan.open_jobs > 0 and self._run_pool(self.record, statistics, stats, self.stop, on_event)
                if self.stop.is_made or not changed:
                    return self._finish(plan, statistics, dict(stats))
                plan = self.plan()
        raise StalePlan(f"rendering {self.record.name}: its files changed {MAX_PLANS} times during the render; run it again when they stay the same")

    def _finish(self, plan: RunPlan, statistics: RunStatistics, stats: Mapping[str, float]) -> RunResult:
        complete = finish(self._workspace, self._catalogue, self.record.name, plan.expected)
        counts = self._catalogue.count_jobs(self.record.name)
        open_jobs = sum(counts[state] for state in OPEN)
        return RunResult(statistics, complete, self.stop.is_made, open_jobs, counts[State.QUARANTINED], self.record.content_version, stats)

    def _prune(self) -> None:
        """Removes stored blocks without a job, such as those of earlier frames. Lists the stores, which takes long in an object store."""
        for track in self.record.tracks:
            if (found := find_track(self._workspace, self.record, track.id, read_only=False)) is not None:
                with found as store:
                    for block in self._without_job(track, [block.id for block in store.list_blocks()]):
                        store.remove_block(block)

    def _without_job(self, track: Track, blocks: list[BlockId]) -> list[BlockId]:
        """Returns the blocks of a track that have no job, from 16 bytes per job."""
        jobs = np.fromiter((_number(job.block) for job in self._catalogue.jobs(self.record.name, track.id)), np.uint64)
        has_job = np.isin(np.fromiter(map(_number, blocks), np.uint64), jobs)
        return [blocks[place] for place in np.flatnonzero(~has_job)]


def _number(block: BlockId) -> int:
    """Returns a number of 57 bits that no other block has."""
    return block.z << 52 | morton(block.x, block.y)
