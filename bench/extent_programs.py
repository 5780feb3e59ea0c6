"""Programs whose memory bench/extent.py measures.

`python -m bench.extent_programs build WORKSPACE SCENE`, `python -m bench.extent_programs render WORKSPACE RENDERING BLOCKS OUT`.

`render` opens a scene, plans, and renders BLOCKS base blocks as `map3d render` does: runs of RUN_LENGTH consecutive jobs, spread over the rendering.
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
from map3d.geometry.core_frame import core_frame
from map3d.jobs.run_settings import RunSettings
from map3d.renderings.plan import plan_jobs
from map3d.scenes.build import build, open_scene
from map3d.subprocess import Handler, Message, ReportProgress, Subprocess
from map3d.tiles.naming import morton

from .resource_monitor import read_status_bytes

WORKERS, MAX_MEMORY_BYTES, RUN_LENGTH = 2, 1 << 30, 5


def open_renderer(setup: Mapping[str, Any]) -> Handler:
    """Returns a handler that renders blocks and responds with statistics, without tiles."""
    scene, frame = _core.Scene(setup["scene"], cache_bytes=setup["cache_bytes"]), core_frame(setup["frame"])

    def handle(request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], Sequence[bytes]]:
        begun, spent = time.perf_counter(), time.process_time()
        block = scene.render_block(frame, *request["block"])
        times = {"wall_s": time.perf_counter() - begun, "cpu_s": time.process_time() - spent}
        return {**times, "stats": block.stats, "scene": scene.stats(), "memory": memory_usage()}, []

    return handle


def memory_usage() -> dict[str, int]:
    """Returns the peak resident memory of this process, and its current anonymous memory, in bytes."""
    return {"peak": read_status_bytes(os.getpid(), "VmHWM:"), "anonymous": read_status_bytes(os.getpid(), "RssAnon:")}


def run_build(root: Path, scene: str) -> None:
    workspace = Workspace(root)
    with workspace.open_catalogue() as catalogue:
        build(workspace, catalogue, scene, threads=WORKERS, max_memory_bytes=MAX_MEMORY_BYTES)


def run_render(root: Path, rendering: str, blocks: int) -> dict[str, Any]:
    """Returns seconds per step and the summed responses of the workers."""
    workspace = Workspace(root)
    with workspace.open_catalogue() as catalogue:
        record = catalogue.rendering(rendering)
    begun = time.perf_counter()
    scene = open_scene(workspace, record.scene)
    opened = time.perf_counter()
    jobs = [job for job in plan_jobs(scene, record, {}) if job.kind == "base"]
    planned = time.perf_counter()
    parent = memory_usage()
    setup = {
        "scene": str(workspace.scene_folder(record.scene).absolute()),
        "cache_bytes": RunSettings(WORKERS, MAX_MEMORY_BYTES).cache_bytes,
        "frame": record.tracks[0].frame.to_json(record.tracks[0].layers),
    }
    responses = _render_blocks(setup, choose_blocks(jobs, blocks))
    return {
        "triangles": scene.triangle_count,
        "base_blocks": len(jobs),
        "parent": parent,
        "children": [part[-1]["memory"] for part in responses if part],
        "open_s": opened - begun,
        "plan_s": planned - opened,
        "render_s": time.perf_counter() - planned,
        **sum_statistics(responses),
    }


def choose_blocks(jobs: list[PlannedJob], count: int) -> list[PlannedJob]:
    """Returns evenly spread runs of neighbours in Morton order."""
    ordered = sorted(jobs, key=lambda job: morton(job.block.x, job.block.y))
    if len(ordered) <= count:
        return ordered
    starts = np.linspace(0, len(ordered) - RUN_LENGTH, count // RUN_LENGTH).round().astype(int)
    return [ordered[start + k] for start in starts for k in range(RUN_LENGTH)]


def _render_blocks(setup: dict[str, Any], jobs: list[PlannedJob]) -> list[list[dict[str, Any]]]:
    """Renders the blocks, one part of the town per worker; returns the responses by worker."""
    responses: list[list[dict[str, Any]]] = [[] for _ in range(WORKERS)]

    def work(number: int) -> None:
        process = Subprocess("bench.extent_programs:open_renderer", setup)
        try:
            process.wait_ready(60)
            for job in jobs[len(jobs) * number // WORKERS : len(jobs) * (number + 1) // WORKERS]:
                response = process.request({"block": list(job.block)}, wall_s=None)
                if not isinstance(response, Message):
                    raise SystemExit(f"bench: {job.block}: {response}")
                responses[number].append(response.value)
        finally:
            process.close()

    threads = [threading.Thread(target=work, args=(number,)) for number in range(WORKERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if sum(map(len, responses)) != len(jobs):
        raise SystemExit("bench: a worker exited before it finished its blocks")
    return responses


def sum_statistics(responses: list[list[dict[str, Any]]]) -> dict[str, Any]:
    """Sums over all blocks; cache counts are the final ones of each worker."""
    flat = [response for part in responses for response in part]
    ends = [part[-1]["scene"] for part in responses if part]
    total: dict[str, Any] = {key: sum(response["stats"][key] for response in flat) for key in ("visibility_s", "shade_s", "encode_s")}
    total |= {key: sum(end[key] for end in ends) for key in ends[0]}
    tiles = sum(response["stats"]["traced_tiles"] for response in flat)
    per_tile = {f"{key}_tile_ms": 1000 * sum(response[f"{key}_s"] for response in flat) / tiles for key in ("wall", "cpu")}
    return {"blocks": len(flat), "tiles": tiles, **per_tile, **total}


if __name__ == "__main__":
    verb, workspace, *rest = sys.argv[1:]
    if verb == "build":
        run_build(Path(workspace), rest[0])
    else:
        Path(rest[2]).write_text(json.dumps(run_render(Path(workspace), rest[0], int(rest[1])), indent=1))
