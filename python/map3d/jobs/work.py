"""`map3d work`: does the jobs of renderings that another process planned."""

import queue
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from map3d.catalogue import Catalogue, RenderingRecord, State, Workspace
from map3d.catalogue.open_catalogue import is_networked
from map3d.errors import BadRequest, NotFound, StoreError
from map3d.jobs.events import PlanAwaited, RenderingLeft, RenderingSkipped, RenderingStarted, RunEvent, StoreAwaited
from map3d.jobs.finish import finish
from map3d.jobs.local_pool import LocalPools, PoolRunner
from map3d.jobs.open_jobs import count_open, has_jobs_left
from map3d.jobs.run_settings import RunSettings
from map3d.jobs.run_statistics import RunStatistics
from map3d.jobs.stop_request import StopRequest
from map3d.tiles.track_stores import tiles_url

SWEEP_S = 60.0
"""How often an idle process sweeps a rendering with waiting jobs."""
MAX_FRUITLESS_RUNS = 3
"""A process without `forever` gives up a rendering after this many runs in which all its workers exited and no job was done."""


@dataclass(frozen=True)
class WorkResult:
    """`incomplete`: the renderings worked on of which some jobs did not end as done; empty when the user stopped the work."""

    statistics: RunStatistics
    stopped: bool
    renderings: list[str]
    incomplete: list[str]


@dataclass
class _Pause:
    """The rendering is left alone until `until_s` (monotonic)."""

    until_s: float = 0.0
    length_s: float = 0.0
    fruitless: int = 0


class Work:
    """Does jobs of the named renderings, or of all in the order of their names, until none are left, or with `forever` until the user stops it.

    Never plans.
    """

    def __init__(
        self,
        workspace: Workspace,
        catalogue: Catalogue,
        settings: RunSettings,
        names: Sequence[str] = (),
        *,
        forever: bool = False,
        run_pool: PoolRunner | None = None,
    ) -> None:
        self._workspace, self._catalogue, self._names, self._forever = workspace, catalogue, tuple(names), forever
        self._timeouts = settings.timeouts
        self._run_pool = run_pool or LocalPools(workspace, catalogue, settings)
        self._pauses: dict[str, _Pause] = {}
        self._outcome: dict[str, bool] = {}
        self._given_up: set[str] = set()
        self._swept_s: dict[str, float] = {}
        self._statistics, self._stats = RunStatistics(), Counter[str]()
        self.stop = StopRequest()

    def run(self, on_event: Callable[[RunEvent], None]) -> WorkResult:
        """Raises NotFound for a name without a rendering, BadRequest when its tiles are files of another workspace."""
        for name in self._names:
            check_tiles_are_here(self._workspace, self._catalogue.rendering(name))
            if not self._catalogue.has_open_jobs(name):
                self._outcome[name] = self._finish(name)
        with self.stop.on_signals():
            while not self.stop.is_made and self._step(on_event):
                pass
        incomplete = [] if self.stop.is_made else [name for name, complete in self._outcome.items() if not complete]
        return WorkResult(self._statistics, self.stop.is_made, list(self._outcome), incomplete)

    def _step(self, on_event: Callable[[RunEvent], None]) -> bool:
        """Works on one rendering, or waits; returns False when nothing is left. With `forever`, also waits for a database that cannot be reached."""
        try:
            record, wait_s = self._next(on_event)
            if record is not None:
                self._work_on(record, on_event)
        except StoreError as error:
            if not self._forever:
                raise
            record, wait_s = None, self._timeouts.longest_pause_s
            on_event(StoreAwaited(str(error)))
        if record is None and wait_s is not None:
            self._sleep(wait_s)
        return record is not None or wait_s is not None

    def _next(self, on_event: Callable[[RunEvent], None]) -> tuple[RenderingRecord | None, float | None]:
        """Returns the next rendering with open jobs; else None and how long to wait, or None and None when nothing is left."""
        now, waits = time.monotonic(), [self._timeouts.poll_s] if self._forever else []
        for record in self._renderings():
            if record.name not in self._given_up and self._has_open_jobs(record.name, now):
                until_s = self._pauses.get(record.name, _Pause()).until_s
                if not self._has_tiles(record, on_event):
                    continue
                if until_s <= now:
                    return record, None
                waits.append(until_s - now)
        return None, min(waits, default=None)

    def _has_open_jobs(self, name: str, now: float) -> bool:
        """Sweeps at most once a minute if no job is open, since a killed process may have left reduce jobs waiting."""
        if self._catalogue.has_open_jobs(name):
            return True
        if now - self._swept_s.get(name, -SWEEP_S) < SWEEP_S:
            return False
        self._swept_s[name] = now
        return self._catalogue.count_jobs(name)[State.WAITING] > 0 and has_jobs_left(self._catalogue, name)

    def _has_tiles(self, record: RenderingRecord, on_event: Callable[[RunEvent], None]) -> bool:
        """Reports a rendering that is skipped because its tiles are elsewhere, once."""
        try:
            check_tiles_are_here(self._workspace, record)
        except BadRequest as error:
            self._given_up.add(record.name)
            on_event(RenderingSkipped(record.name, str(error)))
            return False
        return True

    def _renderings(self) -> list[RenderingRecord]:
        """A named rendering that was removed meanwhile has no jobs."""
        return [record for record in self._catalogue.renderings() if not self._names or record.name in self._names]

    def _work_on(self, record: RenderingRecord, on_event: Callable[[RunEvent], None]) -> None:
        name, done_before = record.name, self._statistics.done
        on_event(RenderingStarted(name, count_open(self._catalogue, name)))
        try:
            changed = self._run_pool(record, self._statistics, self._stats, self.stop, on_event)
            if not changed and not self._catalogue.has_open_jobs(name):
                self._pauses.pop(name, None)
                self._outcome[name] = self._finish(name)
                on_event(RenderingLeft(name, self._outcome[name]))
            elif not self.stop.is_made:
                self._pause(name, done=self._statistics.done > done_before, changed=changed, on_event=on_event)
        except NotFound:
            if any(item.name == name for item in self._catalogue.renderings()):
                raise

    def _finish(self, name: str) -> bool:
        """Writes the manifest; returns whether the rendering is complete. The manifest of a rendering that is being planned, or whose planning was
        killed, is left to the run that plans it to the end."""
        if self._catalogue.rendering(name).planning or not any(self._catalogue.count_jobs(name).values()):
            return False
        return finish(self._workspace, self._catalogue, name)

    def _pause(self, name: str, *, done: bool, changed: bool, on_event: Callable[[RunEvent], None]) -> None:
        """Leaves the rendering alone for a while: it waits for a new plan, or all workers have exited."""
        pause = self._pauses.setdefault(name, _Pause())
        pause.length_s = self._timeouts.plan_s if done else min(max(2 * pause.length_s, self._timeouts.plan_s), self._timeouts.longest_pause_s)
        pause.until_s = time.monotonic() + pause.length_s
        pause.fruitless = 0 if done or changed else pause.fruitless + 1
        if changed:
            on_event(PlanAwaited(name))
        elif pause.fruitless >= MAX_FRUITLESS_RUNS and not self._forever:
            self._given_up.add(name)
            self._outcome[name] = False
            on_event(RenderingLeft(name, False))

    def _sleep(self, seconds: float) -> None:
        """Ends early when the user stops the work."""
        calls: queue.SimpleQueue[object] = queue.SimpleQueue()
        with self.stop.heard_by(calls.put), suppress(queue.Empty):
            if not self.stop.is_made:
                calls.get(timeout=seconds)


def check_tiles_are_here(workspace: Workspace, record: RenderingRecord) -> None:
    """Raises BadRequest when the tiles of the rendering are SQLite files in another workspace than this one, which shares only its catalogue. The run
    that plans writes the manifest beside the tiles."""
    url = workspace.find_catalogue_url()
    if url is not None and is_networked(url) and tiles_url(record) is None and not workspace.manifest_path(record.name).is_file():
        raise BadRequest(
            f"rendering {record.name}: its tiles are files in the workspace of another node; create the rendering with --tiles URL, "
            f"or share the folder and name it with --workspace (here: {workspace.root})"
        )
