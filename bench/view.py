"""1024 × 768 views of a town on one core by stage, cold and warm, orthographic and in perspective; Mitsuba on the same views in the same run.

Cold: a new process whose files are in the page cache. What it takes more than a warm view for visibility is the opening of chunks, what it takes
more for shading the reading and decoding of textures.
"""

import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from map3d import _core

from .peers import PeerMissing
from .view_cameras import SIZE, VIEWS, view_camera
from .view_program import CACHE_BYTES, layer_specs
from .view_town import prepare_town

ROUNDS, SAMPLES = 5, 16
LARGE = 2_000_000
"""From this number of triangles on, Mitsuba has textures of a quarter of the side: it holds all of them in memory, decoded."""
Row = dict[str, Any]


def measure(millions: tuple[float, ...], folder: Path, reps: int, peers: bool) -> list[Row]:
    """Returns a row per town and view, of `reps` processes and pairs each. Times are milliseconds of CPU time: waiting for other programs is not part
    of them."""
    rows: list[Row] = []
    for size in millions:
        scene = prepare_town(folder, size)
        own = [measure_view(scene, name, reps) for name in VIEWS]
        try:
            if peers:
                compare(scene, own, reps)
        except PeerMissing as missing:
            Console().print(f"without Mitsuba: {missing}")
        show(own)
        rows += own
    return rows


def measure_view(scene: Path, name: str, reps: int) -> Row:
    """Measures a view in new processes; the first one brings the files into the page cache."""
    run_program(scene, name, 1)
    runs = [run_program(scene, name, ROUNDS) for _ in range(reps)]
    cold = {stage: statistics.median(run["cold"][stage] for run in runs) for stage in runs[0]["cold"]}
    warm = {stage: statistics.median(run["warm"][stage] for run in runs) for stage in runs[0]["warm"]}
    return {"view": name, **{key: runs[0][key] for key in ("triangles", "bytes", "stats")}, "cold": cold, "warm": warm}


def run_program(scene: Path, name: str, rounds: int) -> Row:
    words = [sys.executable, "-m", "bench.view_program", str(scene), name, str(rounds)]
    # Otherwise the idle threads of NumPy's linear algebra count as CPU time of the first view.
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    answer: Row = json.loads(subprocess.run(words, check=True, capture_output=True, text=True, env=environment).stdout)
    return answer


def compare(folder: Path, rows: list[Row], reps: int) -> None:
    """Adds Mitsuba's time at 16 samples per pixel, in turns with ours. It takes all cores, so the time of all of its threads is compared."""
    from .peers.mitsuba import Mitsuba

    scene = _core.Scene(str(folder), CACHE_BYTES)
    peer = Mitsuba(folder, texture_level=2 if scene.triangle_count > LARGE else 0)
    from tests.oracle.camera_views import CameraViews

    theirs = CameraViews(peer.mitsuba_scene)
    for row in rows:
        view = view_camera(scene, row["view"])
        theirs.layers(view, SAMPLES)
        scene.render_view(view, layer_specs())
        pairs = []
        for _ in range(reps):
            ours = process_ms(lambda view=view: scene.render_view(view, layer_specs()))
            pairs.append((process_ms(lambda view=view: theirs.layers(view, SAMPLES)), ours))
        row["mitsuba_ms"] = statistics.median(other for other, _ in pairs)
        row["ratio"] = statistics.median(other / ours for other, ours in pairs)


def process_ms(work: Callable[[], object]) -> float:
    """Returns the processor time of all threads."""
    begun = time.process_time()
    work()
    return (time.process_time() - begun) * 1e3


def stage_rows(row: Row) -> list[tuple[str, float | None, float | None]]:
    """Returns name, cold and warm milliseconds of each stage of a view."""
    cold, warm = row["cold"], row["warm"]
    encodings = [stage for stage in warm if stage.isupper()]
    return [
        ("open the scene", cold["open"], None),
        ("visibility", warm["visibility"], warm["visibility"]),
        ("open chunks", cold["visibility"] - warm["visibility"], None),
        ("shading", warm["shade"], warm["shade"]),
        ("first use of textures", cold["shade"] - warm["shade"], None),
        ("convert", cold["convert"], warm["convert"]),
        ("other", cold["other"], warm["other"]),
        *((f"encode {stage}", cold[stage], warm[stage]) for stage in encodings),
        ("all", cold["total"], warm["total"]),
    ]


def show(rows: list[Row]) -> None:
    """Prints the stages of each view of a town as a table, and as one that fits into a page of the documentation."""
    title = f"{rows[0]['triangles']:,} triangles, {SIZE[0]} × {SIZE[1]} px, {SAMPLES} samples: milliseconds of CPU time, cold / warm"
    columns = ["stage", *(row["view"] for row in rows)]
    cells: list[list[str]] = []
    for parts in zip(*(stage_rows(row) for row in rows), strict=True):
        cells.append([parts[0][0], *(f"{'' if c is None else f'{c:.0f}'} / {'' if w is None else f'{w:.0f}'}" for _, c, w in parts)])
    if all("ratio" in row for row in rows):
        cells.append(["Mitsuba", *(f"{row['mitsuba_ms']:.0f}" for row in rows)])
        cells.append(["Mitsuba / ours, warm, not encoded", *(f"{row['ratio']:.1f}" for row in rows)])
    table = Table(*columns, title=title)
    for line in cells:
        table.add_row(*line)
    Console(width=140).print(table)
    for line in (columns, ["---"] * len(columns), *cells):
        print(f"| {' | '.join(line)} |")
