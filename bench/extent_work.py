"""Programs whose memory is watched: `python -m bench.extent_work build WORKSPACE SCENE`, and `… render WORKSPACE RENDERING BLOCKS OUT`, which opens,
plans and renders some blocks of a rendering as `map3d render` would.

BLOCKS of the base blocks are rendered: runs of RUN that follow each other in the order of jobs, as a worker takes them, spread over all of it.
"""

import json
import os
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from map3d import _core
from map3d.catalogue import PlannedJob, Workspace
from map3d.geometry.frames import core_frame
from map3d.jobs.run import RunSettings
from map3d.renderings.build import build, open_scene
from map3d.renderings.plan import plan_jobs
from map3d.subprocess import Handler, Message, ReportProgress, Subprocess
from map3d.tiles.naming import morton

from .watch import resident

WORKERS, MAX_MEMORY_BYTES, RUN = 2, 1 << 30, 5


def open_renderer(setup: Mapping[str, Any]) -> Handler:
    """A child that renders blocks and tells how its caches stand, but keeps the tiles to itself."""
    scene, frame = _core.Scene(setup["scene"], cache_bytes=setup["cache_bytes"]), core_frame(setup["frame"])

    def handle(request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], Sequence[bytes]]:
        begun, spent = time.perf_counter(), time.process_time()
        block = scene.render_block(frame, *request["block"])
        times = {"wall_s": time.perf_counter() - begun, "cpu_s": time.process_time() - spent}
        return {**times, "stats": block.stats, "scene": scene.stats(), "memory": memory()}, []

    return handle


def memory() -> dict[str, int]:
    """Of this process, bytes: the most that was ever resident, and what is now without mapped files."""
    return {"peak": resident(os.getpid(), "VmHWM:"), "anonymous": resident(os.getpid(), "RssAnon:")}


def built(workspace: Path, scene: str) -> None:
    place = Workspace(workspace)
    catalogue = place.open_catalogue()
    try:
        build(place, catalogue, scene, threads=WORKERS, max_memory_bytes=MAX_MEMORY_BYTES)
    finally:
        catalogue.close()


def rendered(workspace: Path, rendering: str, blocks: int) -> dict[str, Any]:
    """Seconds of each step, and what the children answered."""
    place = Workspace(workspace)
    catalogue = place.open_catalogue()
    try:
        record = catalogue.rendering(rendering)
    finally:
        catalogue.close()
    begun = time.perf_counter()
    scene = open_scene(place, record.scene)
    opened = time.perf_counter()
    jobs = [job for job in plan_jobs(scene, record, {}) if job.kind == "base"]
    planned = time.perf_counter()
    parent = memory()
    setup = {
        "scene": str(place.scene_folder(record.scene).absolute()),
        "cache_bytes": RunSettings(WORKERS, MAX_MEMORY_BYTES).cache_bytes,
        "frame": record.tracks[0].frame.to_json(record.tracks[0].layers),
    }
    answers = _answers(setup, chosen(jobs, blocks))
    return {
        "triangles": scene.triangle_count,
        "base_blocks": len(jobs),
        "parent": parent,
        "children": [part[-1]["memory"] for part in answers if part],
        "open_s": opened - begun,
        "plan_s": planned - opened,
        "render_s": time.perf_counter() - planned,
        **summed(answers),
    }


def chosen(jobs: list[PlannedJob], count: int) -> list[PlannedJob]:
    """Runs of neighbours in Morton order, the runs evenly spread."""
    ordered = sorted(jobs, key=lambda job: morton(job.block.x, job.block.y))
    if len(ordered) <= count:
        return ordered
    starts = np.linspace(0, len(ordered) - RUN, count // RUN).round().astype(int)
    return [ordered[start + k] for start in starts for k in range(RUN)]


def _answers(setup: dict[str, Any], jobs: list[PlannedJob]) -> list[list[dict[str, Any]]]:
    """The answers of each worker; each has a part of the town to itself."""
    answers: list[list[dict[str, Any]]] = [[] for _ in range(WORKERS)]

    def work(number: int) -> None:
        process = Subprocess("bench.extent_work:open_renderer", setup)
        try:
            process.wait_ready(60)
            for job in jobs[len(jobs) * number // WORKERS : len(jobs) * (number + 1) // WORKERS]:
                answer = process.request({"block": list(job.block)}, wall_s=None)
                if not isinstance(answer, Message):
                    raise SystemExit(f"bench: {job.block}: {answer}")
                answers[number].append(answer.value)
        finally:
            process.close()

    threads = [threading.Thread(target=work, args=(number,)) for number in range(WORKERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if sum(map(len, answers)) != len(jobs):
        raise SystemExit("bench: a worker ended before its blocks were done")
    return answers


def summed(answers: list[list[dict[str, Any]]]) -> dict[str, Any]:
    """Over all blocks; cache counts are those that each child had in the end."""
    flat = [answer for part in answers for answer in part]
    ends = [part[-1]["scene"] for part in answers if part]
    total: dict[str, Any] = {key: sum(answer["stats"][key] for answer in flat) for key in ("visibility_s", "shade_s", "encode_s")}
    total |= {key: sum(end[key] for end in ends) for key in ends[0]}
    tiles = sum(answer["stats"]["traced_tiles"] for answer in flat)
    per_tile = {f"{key}_tile_ms": 1000 * sum(answer[f"{key}_s"] for answer in flat) / tiles for key in ("wall", "cpu")}
    return {"blocks": len(flat), "tiles": tiles, **per_tile, **total}


if __name__ == "__main__":
    verb, place, *rest = sys.argv[1:]
    if verb == "build":
        built(Path(place), rest[0])
    else:
        Path(rest[2]).write_text(json.dumps(rendered(Path(place), rest[0], int(rest[1])), indent=1))
