"""Renders blocks when their tiles are asked for (docs/on-demand.md). One object per process of the server.

The catalogue's leases decide which process renders a block; the others wait for its job. Workers render in subprocesses; a thread of its own ends the
requests that other processes have met, records which blocks were used, and has manifests written.
"""

import logging
import threading
import time
from typing import Final

from map3d.catalogue import Job, RenderingRecord, State, Track, Workspace
from map3d.errors import BadName, Map3dError, NotFound
from map3d.jobs.dead_workers import expire_dead_workers, worker_name
from map3d.jobs.finish_process import finish_in_subprocess
from map3d.jobs.on_demand.block_requests import BlockRequest, BlockRequests
from map3d.jobs.on_demand.cache import BlockAddress, OnDemandCache
from map3d.jobs.on_demand.worker import OnDemandSettings, OnDemandWorker, check_can_be_done, find_job
from map3d.tiles.decode_tile import find_layer
from map3d.types import BlockId

POLL_S: Final = 0.25
"""How often a process looks whether others have done what it waits for."""
REFRESH_S: Final = 1.0
"""How long a record of a rendering counts as current."""
KNOWN_S: Final = 60.0
"""A rendering without requests is not looked up any more after this time."""
FINISH_S: Final = 3.0
"""The manifest is written when no block of the rendering was rendered for this time, and none is waited for."""

log: Final = logging.getLogger("map3d.on_demand")


class _Known:
    """A rendering that was asked for: its record, or None if it does not exist."""

    def __init__(self, record: RenderingRecord | None, now_s: float) -> None:
        self.record, self.asked_s = record, now_s


class OnDemand:
    """Thread-safe. `close` ends the threads and their subprocesses."""

    def __init__(self, workspace: Workspace, settings: OnDemandSettings | None = None) -> None:
        self.settings = settings or OnDemandSettings()
        self._workspace, self._catalogue = workspace, workspace.open_catalogue()
        self.cache = OnDemandCache(workspace, self._catalogue, self.settings.quota_bytes, worker_name(0))
        self.requests = BlockRequests(self.settings.queue)
        self.rendered = 0
        """Number of blocks that this process has rendered."""
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._known: dict[str, _Known] = {}
        self._touched: set[BlockAddress] = set()
        self._unfinished: dict[str, float] = {}
        self._threads: list[threading.Thread] = []

    # -- requests ---------------------------------------------------------------------------------------------------------------

    def find_track(self, rendering: str, view: str, layer: str) -> tuple[RenderingRecord, Track] | None:
        """Returns the rendering and the track of a layer; None if the rendering, the view or the layer do not exist."""
        record = self._record(rendering)
        frame = None if record is None else record.frame(view)
        if record is None or frame is None:
            return None
        found = find_layer(record.layers, layer)
        return None if found is None else next((record, track) for track in record.tracks_of(frame) if found[1] in track.layers)

    def open_job(self, rendering: str, track: str, block: BlockId) -> Job | None:
        """Returns the block's job if it is planned and not done."""
        job = find_job(self._catalogue, rendering, track, block)
        return None if job is None or job.state is State.DONE else job

    def ask(self, job: Job, *, keep: bool = False) -> BlockRequest:
        """Asks for the block of an open job. The caller waits for `BlockRequest.ended` and then calls `leave`; with `keep`, no caller waits. Raises
        Unavailable if it cannot be rendered, or if the queue is full."""
        check_can_be_done(self._catalogue, job, self.settings)
        request = self.requests.add((job.rendering, job.track, job.block), job.kind, keep=keep)
        self._start_threads()
        return request

    def touch(self, rendering: str, track: str, block: BlockId) -> None:
        """Records that a block was used."""
        with self._lock:
            self._touched.add((rendering, track, block))

    def epoch(self, rendering: str) -> object:
        """Returns a value that differs after each plan that opened jobs, within `REFRESH_S`. No I/O for a rendering that was asked for before."""
        known = self._known.get(rendering)
        record = self._record(rendering) if known is None else known.record
        return None if record is None else (record.content_version, record.planning)

    def _record(self, rendering: str) -> RenderingRecord | None:
        self._start_threads()
        now = time.monotonic()
        known = self._known.get(rendering) or self._read(rendering, now)
        known.asked_s = now
        return known.record

    def _read(self, rendering: str, now: float) -> _Known:
        try:
            record = self._catalogue.rendering(rendering)
        except (NotFound, BadName):
            return _Known(None, now)
        known = self._known[rendering] = _Known(record, now)
        return known

    # -- threads ----------------------------------------------------------------------------------------------------------------

    def _start_threads(self) -> None:
        with self._lock:
            if self._threads or self._stop.is_set():
                return
            workers = [self._new_worker(number) for number in range(1, self.settings.workers + 1)]
            self._threads = [threading.Thread(target=worker.run, name=worker.name, daemon=True) for worker in workers]
            self._threads += [threading.Thread(target=target, name="on demand", daemon=True) for target in (self._watch, self._write_manifests)]
            for thread in self._threads:
                thread.start()

    def _new_worker(self, number: int) -> OnDemandWorker:
        name = worker_name(number)
        return OnDemandWorker(name, self._workspace, self._catalogue, self.cache, self.requests, self.settings, self._stop, self._on_done)

    def _on_done(self, rendering: str) -> None:
        with self._lock:
            self.rendered += 1
            self._unfinished[rendering] = time.monotonic()

    def _watch(self) -> None:
        next_s = time.monotonic()
        while not self._stop.wait(POLL_S):
            try:
                self._end_met()
                if time.monotonic() >= next_s:
                    next_s = time.monotonic() + REFRESH_S
                    self._refresh()
            except Exception as error:
                _log(error)

    def _end_met(self) -> None:
        """Ends the requests whose jobs other processes have done."""
        for request in self.requests:
            if self.open_job(*request.address) is None:
                self.requests.end(request)

    def _refresh(self) -> None:
        now = time.monotonic()
        for name, known in list(self._known.items()):
            if now - known.asked_s > KNOWN_S:
                self._known.pop(name, None)
                continue
            fresh = self._read(name, now)
            fresh.asked_s = known.asked_s
            if fresh.record is None:
                self._known.pop(name, None)
        with self._lock:
            touched, self._touched = self._touched, set()
        if touched:
            self.cache.touch(touched)
        for name in {request.address[0] for request in self.requests}:
            expire_dead_workers(self._catalogue, name)

    def _write_manifests(self) -> None:
        while not self._stop.wait(REFRESH_S):
            for name in self._take_finished():
                try:
                    finish_in_subprocess(self._workspace, name)
                except Exception as error:
                    _log(error)

    def _take_finished(self) -> list[str]:
        now = time.monotonic()
        with self._lock:
            idle = [name for name, done_s in self._unfinished.items() if now - done_s >= FINISH_S and not self.requests.of_rendering(name)]
            for name in idle:
                del self._unfinished[name]
        return idle

    def is_alive(self) -> bool:
        """Whether all threads run, once the first block was asked for."""
        return all(thread.is_alive() for thread in self._threads)

    def close(self) -> None:
        self._stop.set()
        self.requests.wake()
        for thread in self._threads:
            thread.join()
        for request in self.requests:
            self.requests.end(request)
        self.cache.close()
        self._catalogue.close()


def _log(error: Exception) -> None:
    log.warning("%s", error, exc_info=not isinstance(error, Map3dError))
