"""`map3d render`: plan, run the workers, write the manifest."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from map3d.catalogue import Catalogue, PlanOutcome, RenderingRecord, State, Workspace
from map3d.errors import BadRequest
from map3d.jobs.events import Event
from map3d.jobs.pool import Pool, Tally
from map3d.jobs.timeouts import Terms
from map3d.renderings.build import open_scene
from map3d.renderings.manifest_writer import Planned, write_manifest
from map3d.renderings.plan import PlannedScene, plan_jobs, planned_occupancy
from map3d.renderings.render_task import CACHE_BYTES, RENDER_ENTRY, RenderTask
from map3d.tiles.naming import block_levels
from map3d.tiles.occupancy import Occupancy, morton_numbers
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId, Box

MIN_CACHE_BYTES: Final = 64 << 20
WORKER_BYTES: Final = 256 << 20
"""Of a child without its cache: interpreter, libraries, a block's G-buffers."""


@dataclass(frozen=True)
class Settings:
    """`max_memory_bytes`: over all workers, None for the default caches."""

    workers: int
    max_memory_bytes: int | None = None
    terms: Terms = field(default_factory=Terms)
    entry: str = RENDER_ENTRY

    @property
    def cache_bytes(self) -> int:
        """Of one child."""
        if self.max_memory_bytes is None:
            return CACHE_BYTES
        each = self.max_memory_bytes // self.workers - WORKER_BYTES
        if each < MIN_CACHE_BYTES:
            need = self.workers * (MIN_CACHE_BYTES + WORKER_BYTES)
            raise BadRequest(
                f"--max-memory {self.max_memory_bytes >> 20} MiB is too little for {self.workers} workers: give {need >> 20} MiB, or fewer --workers"
            )
        return each


@dataclass(frozen=True)
class Plan:
    """What there is to do: jobs by state, base tiles that open blocks of the first pass may fill."""

    outcome: PlanOutcome
    open_jobs: int
    done_jobs: int
    quarantined_jobs: int
    box: Box
    occupancy: Planned


@dataclass(frozen=True)
class Outcome:
    """How a run ended. `complete`: every job is done; `stats`: as RenderTask sums them, empty when nothing was to be done."""

    tally: Tally
    complete: bool
    stopped: bool
    open_jobs: int
    quarantined_jobs: int
    content_version: int
    stats: Mapping[str, float] = field(default_factory=dict)


class Run:
    """One run of a rendering whose scene is built, in steps, so that a caller can show each."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue, rendering: str, settings: Settings) -> None:
        self._workspace, self._catalogue, self._settings = workspace, catalogue, settings
        self.record = catalogue.rendering(rendering)
        self._cache_bytes = settings.cache_bytes
        self._pool: Pool | None = None

    def plan(self, progress: Callable[[int, int], None] | None = None, scene: PlannedScene | None = None) -> Plan:
        """Compares the scene with what is there, opens jobs for what changed, tells clients that more is to come."""
        opened = scene or open_scene(self._workspace, self.record.scene)
        known = _known_blocks(self._catalogue, self.record)
        outcome = self._catalogue.plan(self.record.name, plan_jobs(opened, self.record, known, progress))
        self.record = self._catalogue.rendering(self.record.name)
        self._prune()
        counts = self._catalogue.count_jobs(self.record.name)
        occupancy = self._open_occupancy(opened) if counts[State.DONE] < sum(counts.values()) else {}
        box = opened.box
        if occupancy or outcome.added or not self._workspace.manifest_path(self.record.name).is_file():
            write_manifest(self._workspace, self._catalogue, self.record.name, box, occupancy)
        open_jobs = counts[State.WAITING] + counts[State.TODO] + counts[State.LEASED]
        return Plan(outcome, open_jobs, counts[State.DONE], counts[State.QUARANTINED], box, occupancy)

    def work(self, plan: Plan, on_event: Callable[[Event], None]) -> Outcome:
        """Runs the workers until nothing is left to do or the user stops them, then writes the manifest."""
        if not plan.open_jobs:
            return self._finish(plan, Tally(), False)
        task = RenderTask(self._workspace, self.record, cache_bytes=self._cache_bytes, entry=self._settings.entry)
        self._pool = Pool(self._catalogue, self.record.name, task, self._settings.workers, self._settings.terms)
        try:
            tally = self._pool.run(on_event)
        finally:
            task.close()
        return self._finish(plan, tally, self._pool.stopped, dict(task.stats))

    def stop(self) -> None:
        """Lets the blocks in hand be finished and no more begun."""
        if self._pool is not None:
            self._pool.stop()

    def _finish(self, plan: Plan, tally: Tally, stopped: bool, stats: Mapping[str, float] | None = None) -> Outcome:
        counts = self._catalogue.count_jobs(self.record.name)
        complete = counts[State.DONE] == sum(counts.values())
        write_manifest(self._workspace, self._catalogue, self.record.name, plan.box, {} if complete else self._within_open(plan.occupancy))
        open_jobs = counts[State.WAITING] + counts[State.TODO] + counts[State.LEASED]
        return Outcome(tally, complete, stopped, open_jobs, counts[State.QUARANTINED], self.record.content_version, stats or {})

    def _prune(self) -> None:
        """Removes blocks that no job stands for, such as those of frames pinned before."""
        for track in self.record.tracks:
            path = self._workspace.store_path(self.record.name, track.id)
            if path.is_file():
                jobs = {job.block for job in self._catalogue.jobs(self.record.name, track.id)}
                with SqliteTileStore(path) as store:
                    for block in store.list_blocks():
                        if block.id not in jobs:
                            store.remove_block(block.id)

    def _open_occupancy(self, scene: PlannedScene) -> dict[str, Occupancy]:
        """Where the first pass of a view is done, its tiles say exactly where those of further passes will be."""
        return {frame.id: planned_occupancy(scene, self.record, frame, within=self._open_blocks(frame.id)) for frame in self.record.frames}

    def _open_blocks(self, view: str) -> list[BlockId]:
        """Base blocks of the view's first pass that are not done."""
        return [job.block for job in self._catalogue.jobs(self.record.name, view) if job.kind == "base" and job.state is not State.DONE]

    def _within_open(self, whole: Planned) -> dict[str, Occupancy]:
        """Only what lies in base blocks that are not done now."""
        root = block_levels(self.record.zmax)[0].root
        cut = {}
        for view, occupancy in whole.items():
            blocks = self._open_blocks(view)
            x, y = np.array([block.x for block in blocks], np.int64), np.array([block.y for block in blocks], np.int64)
            base = occupancy.numbers(self.record.zmax)
            above = base >> np.uint64(2 * (self.record.zmax - root))
            cut[view] = Occupancy(self.record.zmax, base[np.isin(above, morton_numbers(x, y))])
        return cut


def _known_blocks(catalogue: Catalogue, record: RenderingRecord) -> dict[str, list[BlockId]]:
    known: dict[str, list[BlockId]] = {track.id: [] for track in record.tracks}
    for job in catalogue.jobs(record.name):
        if job.kind == "base" and job.track in known:
            known[job.track].append(job.block)
    return known
