"""Makes a town: plans it, checks the room on the disk, has the jobs done, keeps the record."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from pathlib import Path

from map3d_town.errors import TownError
from map3d_town.measure import check_room, measured
from map3d_town.site import Site, begun, claimed, finish, record
from map3d_town.spec import Estimate, TownSpec
from map3d_town.work import Job, do, jobs_of

Progress = Callable[[str, int, int], None]
Outcome = tuple[Job, dict[str, int], dict[str, int]]


@dataclass(frozen=True)
class TownReport:
    """What was made: counts, and the files written now and kept from before."""

    buildings: int
    trees: int
    textures: int
    written: int
    kept: int
    disk_bytes: int


def make_town(out: Path, spec: TownSpec, progress: Progress | None = None, workers: int = 1) -> TownReport:
    """Writes the town into `out`, or what is missing of it.

    Raises TownError when `out` holds a town of another spec, or the disk has too little room. `progress(what, done, all)` is called
    after each job. When it is interrupted, killed even, all complete files are kept.
    """
    done = begun(out, spec)
    site = Site(out, spec, done)
    jobs = list(jobs_of(site))
    check_room(site)
    files: dict[str, int] = {}
    written = 0
    with claimed(out):
        record(out, spec, site.plan, done)
        for count, (job, made, kept) in enumerate(results(site, jobs, workers), 1):
            written += len(made)
            files |= made | kept
            if progress:
                progress(job.kind, count, len(jobs))
        finish(out, spec, site.plan, files)
    textures = sum("/textures/a" in name and not name.startswith("obj/") for name in files)
    return TownReport(len(site.plan.lots), len(site.plan.trees), textures, written, len(files) - written, sum(files.values()))


def estimate_town(spec: TownSpec) -> Estimate:
    """What the town will take, within 15 %: it is planned, and a sample of it is made in memory. Nothing is written."""
    return measured(Site(Path(), spec, {}))


def results(site: Site, jobs: list[Job], workers: int) -> Iterator[Outcome]:
    """Does the jobs, here or in processes of their own; each is told as soon as it is done."""
    if workers <= 1:
        for job in jobs:
            yield do(site, job)
        return
    context = get_context("spawn")
    site.stop = context.Event()
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_settle, initargs=(site,)) as pool:
        try:
            yield from (future.result() for future in as_completed([pool.submit(_do_here, job) for job in jobs]))
        except BrokenProcessPool as error:
            raise TownError(f"{site.out}: a process ended all at once, for want of memory perhaps; give the same command again to go on") from error
        finally:
            site.stop.set()
            pool.shutdown(cancel_futures=True)


_SITE: list[Site] = []


def _settle(site: Site) -> None:
    """A worker's beginning. An interrupt is the parent's to handle; without a parent there is nothing to work for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _SITE[:] = [site]


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _do_here(job: Job) -> Outcome:
    return do(_SITE[0], job)
