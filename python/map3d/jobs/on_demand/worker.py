"""A thread that renders the blocks that requests wait for, one after another, with one subprocess."""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final

from map3d.catalogue import Catalogue, Job, RenderingRecord, State, Workspace
from map3d.errors import Map3dError, NotFound, Unavailable
from map3d.jobs.events import JobDone, JobOutcome, SceneChanged
from map3d.jobs.job_runner import JobRunner
from map3d.jobs.on_demand.block_requests import BUSY_RETRY_S, BlockRequest, BlockRequests
from map3d.jobs.on_demand.cache import OnDemandCache
from map3d.jobs.on_demand.task import OnDemandTask
from map3d.jobs.timeouts import Timeouts
from map3d.renderings.render_task import CACHE_BYTES, RENDER_ENTRY, RenderTask
from map3d.subprocess import Limits
from map3d.types import BlockId

BLOCK_S: Final = 300.0
STALE_RETRY_S: Final = 60
log: Final = logging.getLogger("map3d.on_demand")


@dataclass(frozen=True)
class OnDemandSettings:
    """`workers`: threads of each process of the server, each with a subprocess; `queue`: number of blocks that requests may wait for
    in each process.

    `most_blocks`: a tile of an upper level is rendered only if at most this many base blocks below it are open. `memory_bytes`: cache of each
    subprocess; `idle_s`: a subprocess without work ends after this time.
    """

    workers: int = 1
    queue: int = 64
    most_blocks: int = 256
    quota_bytes: int = 5_000_000_000
    memory_bytes: int = CACHE_BYTES
    idle_s: float = 300.0
    timeouts: Timeouts = field(default_factory=lambda: Timeouts(block_s=BLOCK_S, start_s=60.0, starts=3))
    entry: str = RENDER_ENTRY


@dataclass
class _Open:
    """The rendering that the worker's subprocess has open."""

    record: RenderingRecord
    built: str | None
    task: RenderTask
    wrapped: OnDemandTask
    runner: JobRunner

    def close(self) -> None:
        self.runner.close()
        self.task.close()


class OnDemandWorker:
    """Runs in its own thread until `stop` is set. `on_done` is called with the name of the rendering after each rendered block."""

    def __init__(
        self,
        name: str,
        workspace: Workspace,
        catalogue: Catalogue,
        cache: OnDemandCache,
        requests: BlockRequests,
        settings: OnDemandSettings,
        stop: threading.Event,
        on_done: Callable[[str], None],
    ) -> None:
        self.name, self._workspace, self._catalogue, self._cache = name, workspace, catalogue, cache
        self._requests, self._settings, self._stop, self._on_done = requests, settings, stop, on_done
        self._open: _Open | None = None

    def run(self) -> None:
        idle_since_s = time.monotonic()
        try:
            while not self._stop.is_set():
                since = self._requests.version
                if self._work_on_next():
                    idle_since_s = time.monotonic()
                    continue
                if time.monotonic() - idle_since_s > self._settings.idle_s:
                    self._close()
                self._requests.wait(since, self._settings.timeouts.idle_s)
        finally:
            self._close()

    def _work_on_next(self) -> bool:
        """Does one job of the first request that has one to do; returns False if there is none."""
        for request in self._requests:
            if self._stop.is_set():
                return False
            try:
                if self._work_on(request):
                    return True
            except Map3dError as error:
                self._close()
                self._requests.end(request, error)
            except Exception as error:
                log.exception("cannot render block %s of %s", request.address[2], request.address[0])
                self._close()
                self._requests.end(request, error)
        return False

    def _work_on(self, request: BlockRequest) -> bool:
        rendering, track, block = request.address
        job = self._catalogue.job(rendering, track, block)
        if job is None or job.state is State.DONE:
            self._requests.end(request)
            return False
        for wanted in open_jobs(self._catalogue, job):
            if wanted.state in (State.QUARANTINED, State.CANCELLED):
                raise Unavailable(cannot_render(wanted), STALE_RETRY_S)
            if self._may_lease(wanted) and self._do(wanted):
                return True
        if job.state is State.WAITING:
            self._catalogue.sweep(rendering)
        return False

    def _may_lease(self, job: Job) -> bool:
        is_overdue = job.expires_s is not None and job.expires_s < self._catalogue.clock_s()
        return job.state is State.TODO or (job.state is State.LEASED and is_overdue)

    def _do(self, job: Job) -> bool:
        """Does a job unless another worker has leased it meanwhile."""
        opened = self._opened(job.rendering)
        if opened is None or not opened.runner.make_ready(self._stop):
            return False
        lease = self._catalogue.lease_block(job.rendering, self.name, job.track, job.block)
        if lease is None:
            return False
        self._handle(opened, opened.runner.run(lease))
        return True

    def _handle(self, opened: _Open, outcome: JobOutcome) -> None:
        rendering, place = opened.record.name, (opened.record.name, outcome.lease.track, outcome.lease.block)
        if isinstance(outcome, JobDone):
            self._on_done(rendering)
            if (request := self._requests.find(place)) is not None:
                self._requests.end(request)
            self._requests.wake()
        elif isinstance(outcome, SceneChanged):
            self._close()
            text = f"the scene of rendering {rendering} has changed; run map3d render {rendering} --plan-only"
            for request in self._requests.of_rendering(rendering):
                self._requests.end(request, Unavailable(text, STALE_RETRY_S))
        else:
            log.warning("block %s of track %s of rendering %s: %s", outcome.lease.block, outcome.lease.track, rendering, outcome.reason)
            if opened.wrapped.refusal is not None:
                for request in self._requests.of_rendering(rendering):
                    self._requests.end(request, Unavailable(str(opened.wrapped.refusal), STALE_RETRY_S))

    def _opened(self, rendering: str) -> _Open | None:
        """Opens the rendering, or opens it again if it has changed since."""
        record = self._catalogue.rendering(rendering)
        scene = self._catalogue.scene(record.scene)
        known = self._open
        if known is not None and (known.record.name, known.record.frames, known.record.passes, known.built) == (
            rendering,
            record.frames,
            record.passes,
            scene.built,
        ):
            return known
        self._close()
        limits = Limits(cpu_s=int(2 * self._settings.timeouts.block_s), network=False)
        task = RenderTask(self._workspace, record, cache_bytes=self._settings.memory_bytes, entry=self._settings.entry, scene=scene, limits=limits)
        wrapped = OnDemandTask(task, self._cache)
        runner = JobRunner(self._catalogue, wrapped, self._settings.timeouts, self._stop)
        self._open = _Open(record, scene.built, task, wrapped, runner)
        return self._open

    def _close(self) -> None:
        if self._open is not None:
            self._open.close()
            self._open = None


def open_jobs(catalogue: Catalogue, job: Job) -> Iterator[Job]:
    """Yields the jobs that have to be done for this one and can be done now, or that prevent it: itself, or those below a waiting job."""
    if job.state is not State.WAITING:
        yield job
        return
    for below in catalogue.jobs_below(job.rendering, job.track, job.block):
        if below.state is not State.DONE:
            yield from open_jobs(catalogue, below)


def count_open_base(catalogue: Catalogue, job: Job, limit: int) -> int:
    """Returns the number of base jobs that have to be done for this one, but at most limit + 1."""
    if job.kind == "base":
        return 1
    count = 0
    below = catalogue.jobs_below(job.rendering, job.track, job.block) if job.state is State.WAITING else []
    for one in below:
        if one.state is not State.DONE:
            count += count_open_base(catalogue, one, limit - count)
        if count > limit:
            break
    return min(count, limit + 1)


def cannot_render(job: Job) -> str:
    how = "was cancelled" if job.state is State.CANCELLED else "failed three times"
    return f"block {job.block} of track {job.track} {how}; run map3d jobs retry {job.rendering}"


def check_can_be_done(catalogue: Catalogue, job: Job, settings: OnDemandSettings) -> None:
    """Raises Unavailable for a tile that is not rendered on demand."""
    if job.state in (State.QUARANTINED, State.CANCELLED):
        raise Unavailable(cannot_render(job), STALE_RETRY_S)
    if job.kind == "reduce" and count_open_base(catalogue, job, settings.most_blocks) > settings.most_blocks:
        text = f"this tile needs more than {settings.most_blocks} blocks that are not rendered yet; look at a smaller part of the map"
        raise Unavailable(f"{text}, or run map3d render {job.rendering}", STALE_RETRY_S)


def find_job(catalogue: Catalogue, rendering: str, track: str, block: BlockId) -> Job | None:
    """Returns the job of a block; None if rendering or job do not exist."""
    try:
        return catalogue.job(rendering, track, block)
    except NotFound:
        return None


__all__ = ["BUSY_RETRY_S", "OnDemandSettings", "OnDemandWorker", "check_can_be_done", "count_open_base", "find_job"]
