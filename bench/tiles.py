"""Base tiles with content per second, with and without encoding, on one core and on all."""

import multiprocessing
import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from map3d import _core
from map3d.geometry.core_frame import core_frame
from map3d.tiles.occupancy import xy_from_morton

from . import peer_comparison
from .benchmark_scene import CACHE, FrameFields, prepare_scene
from .peers.map3d_peer import encode_tile

Tile = tuple[int, int]


def choose_tiles(scene: _core.Scene, frame: _core.Frame, count: int) -> list[Tile]:
    """Returns evenly spaced base tiles with content."""
    places = occupied_tiles(scene, frame)
    chosen = places[:: max(1, len(places) // (2 * count))]
    return tiles_with_content(scene, frame, chosen)[:count]


def occupied_tiles(scene: _core.Scene, frame: _core.Frame) -> list[Tile]:
    """Base tiles that may have content, row by row."""
    columns, rows = xy_from_morton(scene.occupied(frame, frame.zmax))
    return sorted(zip(columns.tolist(), rows.tolist(), strict=True), key=lambda tile: tile[::-1])


def tiles_with_content(scene: _core.Scene, frame: _core.Frame, places: list[Tile]) -> list[Tile]:
    return [tile for tile in places if scene.gbuffer(frame, *tile)["id"].any()]


def seconds(work: Callable[[], object], rounds: int = 3) -> float:
    """Returns the median wall time of a call."""
    times = []
    for _ in range(rounds):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)


def trace(scene: _core.Scene, frame: _core.Frame, tiles: list[Tile]) -> None:
    for tile in tiles:
        scene.gbuffer(frame, *tile)


def trace_and_encode(scene: _core.Scene, frame: _core.Frame, tiles: list[Tile]) -> None:
    for tile in tiles:
        encode_tile(frame.layers, scene.gbuffer(frame, *tile))


def _worker(folder: str, fields: FrameFields, tiles: list[Tile], ready: Any, go: Any, done: Any) -> None:
    scene, frame = _core.Scene(folder), core_frame(fields)
    trace_and_encode(scene, frame, tiles)
    ready.release()
    go.wait()
    trace_and_encode(scene, frame, tiles)
    done.release()


def all_cores(folder: Path, fields: FrameFields, tiles: list[Tile], cores: int) -> float:
    """Returns the seconds to trace and encode all tiles in one process per core, with warm caches."""
    context = multiprocessing.get_context("spawn")
    ready, go, done = context.Semaphore(0), context.Event(), context.Semaphore(0)
    parts = [tiles[k::cores] for k in range(cores)]
    workers = [context.Process(target=_worker, args=(str(folder), fields, part, ready, go, done)) for part in parts]
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


def measure(buildings: int, res_m: float, count: int, color: str) -> dict[str, Any]:
    """Returns a row of the table, in tiles per second."""
    folder, frames = prepare_scene(buildings, res_m, color)
    fields = next(iter(frames.values()))
    frame = core_frame(fields)
    scene = _core.Scene(str(folder), 1 << 30)
    tiles = choose_tiles(scene, frame, count)
    trace(scene, frame, tiles)
    cores = len(os.sched_getaffinity(0))
    plain = len(tiles) / seconds(lambda: trace(scene, frame, tiles))
    encoded = len(tiles) / seconds(lambda: trace_and_encode(scene, frame, tiles))
    total = len(tiles) / all_cores(folder, fields, tiles, cores)
    return {
        "triangles": scene.triangle_count,
        "tiles": len(tiles),
        "color": color,
        "cores": cores,
        "one_core": plain,
        "one_core_encoded": encoded,
        "all_cores_encoded": total,
    }


def measure_peers(buildings: int, res_m: float) -> dict[str, Any]:
    """Compares with other renderers on the same town."""
    folder, frames = prepare_scene(buildings, res_m, "webp")
    fields = next(iter(frames.values()))
    frame = core_frame(fields)
    scene = _core.Scene(str(folder), 1 << 30)
    places = occupied_tiles(scene, frame)
    tiles = tiles_with_content(scene, frame, places)
    shown = max(tiles, key=lambda tile: len(np.unique(scene.gbuffer(frame, *tile)["id"])))
    return peer_comparison.measure(folder, fields, tiles, shown, pictures=CACHE / "pictures")


def measure_all(buildings: int, res_m: float, count: int) -> list[dict[str, Any]]:
    """Measures both colour formats and prints the table; returns its rows and those of the peers."""
    rows = [measure(buildings, res_m, count, color) for color in ("webp", "jpeg")]
    table = Table(title=f"base tiles per second, 256 px, 16 samples, colour and data tiles, {buildings} buildings at {res_m} m per pixel")
    for column in ("triangles", "tiles", "colour", "one core", "one core, encoded", "all cores, encoded"):
        table.add_column(column, justify="right")
    for row in rows:
        rates = [f"{row[key]:.1f}" for key in ("one_core", "one_core_encoded", "all_cores_encoded")]
        table.add_row(f"{row['triangles']:,}", str(row["tiles"]), row["color"], *rates)
    Console().print(table)
    return [*rows, measure_peers(buildings, res_m)]
