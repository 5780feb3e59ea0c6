"""Non-empty base tiles a second: ours with and without encoding, per core and in total; Mitsuba 3 on the same tiles, without encoding."""

import json
import multiprocessing
import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from map3d import _core

from .scene import prepared, zmax

Tile = tuple[int, int]


def busy_tiles(scene: _core.Scene, frame: str, count: int) -> list[Tile]:
    """Evenly chosen among the base tiles that have content."""
    places = [(int(x), int(y)) for y, x in np.argwhere(scene.occupied(frame, zmax(frame)))]
    chosen = places[:: max(1, len(places) // (2 * count))]
    return [tile for tile in chosen if scene.gbuffer(frame, *tile)["id"].any()][:count]


def seconds(work: Callable[[], object], rounds: int = 3) -> float:
    """Median wall time of a call."""
    times = []
    for _ in range(rounds):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)


def trace(scene: _core.Scene, frame: str, tiles: list[Tile]) -> None:
    for tile in tiles:
        scene.gbuffer(frame, *tile)


def trace_and_encode(scene: _core.Scene, frame: str, tiles: list[Tile]) -> None:
    layers = json.loads(frame)["layers"]
    for tile in tiles:
        buffer = scene.gbuffer(frame, *tile)
        for layer in layers:
            _core.encode_layer(layer["kind"], layer["format"], buffer[layer["kind"]], layer.get("quality", 80))


def _worker(folder: str, frame: str, tiles: list[Tile], ready: Any, go: Any, done: Any) -> None:
    scene = _core.Scene(folder)
    trace_and_encode(scene, frame, tiles)
    ready.release()
    go.wait()
    trace_and_encode(scene, frame, tiles)
    done.release()


def all_cores(folder: Path, frame: str, tiles: list[Tile], cores: int) -> float:
    """Seconds for all tiles, encoded, by one process a core with warm caches."""
    context = multiprocessing.get_context("spawn")
    ready, go, done = context.Semaphore(0), context.Event(), context.Semaphore(0)
    parts = [tiles[k::cores] for k in range(cores)]
    workers = [context.Process(target=_worker, args=(str(folder), frame, part, ready, go, done)) for part in parts]
    for worker in workers:
        worker.start()
    for _ in workers:
        ready.acquire()
    begun = time.perf_counter()
    go.set()
    for _ in workers:
        done.acquire()
    elapsed = time.perf_counter() - begun
    for worker in workers:
        worker.join()
    return elapsed


def mitsuba(folder: Path, frame: str, tiles: list[Tile], samples: int = 16) -> float | None:
    """Seconds for the tiles' albedo, depth, normal and shape; None, said aloud, when Mitsuba is not installed."""
    try:
        from tests.oracle.asset import read_asset
        from tests.oracle.mitsuba_scene import MitsubaScene
    except ImportError as error:
        print(f"peer skipped: Mitsuba 3 ({error}); pip install map3d[peers]")
        return None
    assets = [read_asset(path.parent) for path in sorted(folder.glob("assets/*/mesh.m3a"))]
    index = json.loads((folder / "scene.json").read_text())
    scene = MitsubaScene(assets, np.array(index["origin"]), lambda asset, material: _image(asset.folder, material))
    parsed = json.loads(frame)
    scene.layers(parsed, *tiles[0], samples)
    return seconds(lambda: [scene.layers(parsed, *tile, samples) for tile in tiles], rounds=1)


def _image(folder: Path, material: dict[str, Any]) -> np.ndarray | None:
    from PIL import Image

    if material["texture"] is None:
        return None
    (path,) = (folder / "textures").glob(f"{material['texture']}.*")
    return np.array(Image.open(path).convert("RGB"))


def measure(buildings: int, res_m: float, count: int, color: str) -> dict[str, Any]:
    """One row of the table; tiles a second."""
    folder, frames = prepared(buildings, res_m, color)
    frame = next(iter(frames.values()))
    scene = _core.Scene(str(folder), 1 << 30)
    tiles = busy_tiles(scene, frame, count)
    trace(scene, frame, tiles)
    cores = len(os.sched_getaffinity(0))
    plain = len(tiles) / seconds(lambda: trace(scene, frame, tiles))
    encoded = len(tiles) / seconds(lambda: trace_and_encode(scene, frame, tiles))
    total = len(tiles) / all_cores(folder, frame, tiles, cores)
    peer_time = mitsuba(folder, frame, tiles[: min(12, len(tiles))])
    peer = None if peer_time is None else min(12, len(tiles)) / peer_time
    return {
        "triangles": scene.triangle_count,
        "tiles": len(tiles),
        "color": color,
        "cores": cores,
        "one_core": plain,
        "one_core_encoded": encoded,
        "all_cores_encoded": total,
        "mitsuba_all_cores": peer,
    }
