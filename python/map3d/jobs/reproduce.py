"""`map3d jobs reproduce`: does one job alone, as a worker would, and commits nothing."""

import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from map3d.catalogue import Catalogue, Job, Lease, RenderingRecord, State, Workspace
from map3d.errors import LimitExceeded, Map3dError, NotFound, StalePlan, SubprocessDied, SubprocessStartFailed, SubprocessTimedOut
from map3d.jobs.run_settings import RunSettings
from map3d.renderings.block_check import check_rendered
from map3d.renderings.render_task import RenderTask, stored_tiles
from map3d.subprocess import Failure, Message, Subprocess
from map3d.tiles.tile_store import StoreShape
from map3d.types import BlockId

SAMPLE_S: Final = 0.02
"""How often the memory of the subprocess is read."""


@dataclass(frozen=True)
class Reproduction:
    """What a job did. `outcome`: done, failed (an exception that the subprocess survived), died, timed out, limit exceeded, scene changed, refused
    (the check before the commit) or not started. `signal`: that ended the subprocess; `peak_bytes`: its greatest resident memory as far as it was
    seen; `tiles`: number of images by level; `output`: the last lines that it printed."""

    track: str
    block: BlockId
    kind: str
    state: State
    outcome: str
    reason: str
    signal: str | None
    seconds: float
    peak_bytes: int
    tiles: dict[int, int]
    bytes: int
    output: list[str]

    @property
    def is_done(self) -> bool:
        return self.outcome == "done"


def reproduce(
    workspace: Workspace, catalogue: Catalogue, rendering: str, block: BlockId, settings: RunSettings, track: str | None = None
) -> list[Reproduction]:
    """Does the jobs of the block: of `track`, or of all tracks in which it is quarantined, or else of the first track. Raises NotFound."""
    record = catalogue.rendering(rendering)
    jobs = _jobs_of(catalogue, record, block, track)
    task = RenderTask(workspace, record, cache_bytes=settings.cache_bytes, entry=settings.entry, scene=catalogue.scene(record.scene))
    try:
        return [_reproduce(task, record, job, settings) for job in jobs]
    finally:
        task.close()


def _jobs_of(catalogue: Catalogue, record: RenderingRecord, block: BlockId, track: str | None) -> list[Job]:
    tracks = [item.id for item in record.tracks]
    if track is not None and track not in tracks:
        raise NotFound(f"rendering {record.name}: no track {track!r}; its tracks are {', '.join(tracks)}")
    chosen = tracks if track is None else [track]
    found = [job for item in chosen for job in catalogue.jobs(record.name, item) if job.block == block]
    if not found:
        raise NotFound(f"rendering {record.name}: no block {block}; map3d jobs {record.name} lists those in quarantine")
    return [job for job in found if job.state is State.QUARANTINED] or found[:1]


def _reproduce(task: RenderTask, record: RenderingRecord, job: Job, settings: RunSettings) -> Reproduction:
    lease = Lease(job.rendering, job.track, job.block, job.kind, job.key, job.fence, job.attempts, "reproduce", record.content_version)
    empty = Reproduction(job.track, job.block, job.kind, job.state, "", "", None, 0.0, 0, {}, 0, [])
    started, memory = time.monotonic(), _PeakMemory()
    process: Subprocess | None = None
    try:
        process = task.start_subprocess()
        process.wait_ready(settings.timeouts.start_s)
        memory.pid, started = process.pid, time.monotonic()
        response = process.request(task.request(lease), wall_s=settings.timeouts.block_s, every_s=SAMPLE_S, on_progress=memory.sample)
        memory.sample(None)
        outcome = _judge(record, job, response, empty)
    except Map3dError as error:
        outcome = replace(empty, outcome=_name(error), reason=str(error))
    seconds = time.monotonic() - started
    if process is not None:
        outcome = replace(outcome, signal=process.ended_by, output=process.output_tail())
        process.close()
    return replace(outcome, seconds=seconds, peak_bytes=memory.peak_bytes)


def _judge(record: RenderingRecord, job: Job, response: Message | Failure, empty: Reproduction) -> Reproduction:
    """Raises Corrupt when the block would be refused before its commit."""
    if isinstance(response, Failure):
        outcome = "scene changed" if response.kind == StalePlan.__name__ else "failed"
        return replace(empty, outcome=outcome, reason=f"{response.kind}: {response.message}")
    tiles, seam = stored_tiles(response)
    layers = next(track.layers for track in record.tracks if track.id == job.track)
    check_rendered(StoreShape(record.tile_px, record.zmax, layers), job.block, tiles, seam)
    levels = Counter(tile.z for tile in tiles)
    return replace(empty, outcome="done", tiles=dict(sorted(levels.items())), bytes=sum(len(tile.data) for tile in tiles))


_NAMES: Final = {SubprocessStartFailed: "not started", SubprocessTimedOut: "timed out", SubprocessDied: "died", LimitExceeded: "limit exceeded"}


def _name(error: Map3dError) -> str:
    return next((name for kind, name in _NAMES.items() if isinstance(error, kind)), "refused")


class _PeakMemory:
    """The greatest resident memory of a process, read while it runs (Linux only; 0 elsewhere)."""

    def __init__(self) -> None:
        self.pid, self.peak_bytes = 0, 0

    def sample(self, _progress: object) -> None:
        try:
            status = Path(f"/proc/{self.pid}/status").read_text()
        except OSError:
            return
        for line in status.splitlines():
            if line.startswith("VmHWM:"):
                self.peak_bytes = max(self.peak_bytes, int(line.split()[1]) << 10)
