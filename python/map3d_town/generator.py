"""Generates a town: plans it, checks the disk space, runs the jobs."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from pathlib import Path

from map3d_town.disk_estimate import check_disk_space, estimate_from_sample
from map3d_town.output_folder import TownFolder, finish_town, lock_folder, read_completed_files, write_town_json
from map3d_town.production_jobs import JobFiles, ProductionJob, list_jobs, run_job
from map3d_town.town_errors import TownError
from map3d_town.town_spec import TownEstimate, TownSpec

ProgressCallback = Callable[[str, int, int], None]


@dataclass(frozen=True)
class TownReport:
    """Counts of a finished town; `written`, `kept`: files written by this run, and by earlier ones."""

    buildings: int
    trees: int
    textures: int
    written: int
    kept: int
    disk_bytes: int


def make_town(out: Path, spec: TownSpec, progress: ProgressCallback | None = None, workers: int = 1) -> TownReport:
    """Generates the town in `out`, or its missing files.

    Raises TownError if `out` holds another town or the disk space is insufficient. Calls `progress(stage, done, total)` after each job. An
    interrupted or killed run leaves all complete files.
    """
    completed = read_completed_files(out, spec)
    town = TownFolder(out, spec, completed)
    jobs = list(list_jobs(town))
    check_disk_space(town)
    files: dict[str, int] = {}
    written = 0
    with lock_folder(out):
        write_town_json(out, spec, town.plan, completed)
        for count, result in enumerate(run_jobs(town, jobs, workers), 1):
            written += len(result.written)
            files |= result.written | result.kept
            if progress:
                progress(result.kind, count, len(jobs))
        finish_town(out, spec, town.plan, files)
    textures = sum("/textures/a" in name and not name.startswith("obj/") for name in files)
    return TownReport(len(town.plan.buildings), len(town.plan.trees), textures, written, len(files) - written, sum(files.values()))


def estimate_town(spec: TownSpec) -> TownEstimate:
    """Estimates the disk space within 15 % from a sample that it generates in memory; writes nothing."""
    return estimate_from_sample(TownFolder(Path(), spec, {}))


def run_jobs(town: TownFolder, jobs: list[ProductionJob], workers: int) -> Iterator[JobFiles]:
    """Runs the jobs, in `workers` processes if there are several; yields the files of each finished job."""
    if workers <= 1:
        for job in jobs:
            yield run_job(town, job)
        return
    context = get_context("spawn")
    town.stop = context.Event()
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker, initargs=(town,)) as pool:
        try:
            yield from (future.result() for future in as_completed([pool.submit(_run_in_worker, job) for job in jobs]))
        except BrokenProcessPool as error:
            raise TownError(f"{town.root}: a worker process died, possibly out of memory; re-run to complete the town") from error
        finally:
            town.stop.set()
            pool.shutdown(cancel_futures=True)


_WORKER_TOWN: list[TownFolder] = []


def _start_worker(town: TownFolder) -> None:
    """Initializes a worker process: ignores SIGINT, which the parent handles, and exits with the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    _WORKER_TOWN[:] = [town]


def _exit_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run_in_worker(job: ProductionJob) -> JobFiles:
    return run_job(_WORKER_TOWN[0], job)
