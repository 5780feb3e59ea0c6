"""Time and memory of planning a country: `python -m bench planning`. Each row is a process of its own.

Rows "jobs": only making the jobs, from a synthetic scene whose keys cost nothing. Rows "core": the same with a built scene of houses on a ground
plane, so with the real occupancy and keys; then the occupancy of base tiles that a render announces in the manifest, encoded. Rows "catalogue":
planning into an empty SQLite catalogue, then again with nothing changed.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from map3d import _core
from map3d.catalogue import PlannedJob, RenderingRecord, SceneRecord, Workspace
from map3d.cli import app
from map3d.geometry.frames import pin
from map3d.renderings.plan import PlannedScene, plan_jobs, planned_occupancy
from map3d.scenes.build import BUILD_BYTES, build, open_scene
from map3d.tiles.occupancy import Numbers, morton_numbers, numbers_of
from map3d.types import Box, Layer, ViewAngles

SIZES = (1_000_000, 10_000_000)
LAYERS = (Layer("color", "color", "webp", 80), Layer("id", "id", "png"))
RES_M, BLOCK_PX = 0.05, 2048
HOUSES = 100
"""Houses along a side of the core's scene."""


@dataclass(frozen=True)
class PlanningRow:
    """`cpu_s`: CPU time, `seconds`: elapsed; `peak_bytes`: peak resident memory, of which `start_bytes` before planning."""

    what: str
    base_blocks: int
    jobs: int
    seconds: float
    cpu_s: float
    start_bytes: int
    peak_bytes: int


class SyntheticScene:
    """`count` base blocks in a square, with every other 64 × 64 blocks empty, as between cities; keys cost nothing."""

    def __init__(self, count: int) -> None:
        side = int(np.ceil((2 * count) ** 0.5 / 128)) * 2
        x, y = np.meshgrid(np.arange(side), np.arange(side))
        squares = np.sort(morton_numbers(x[(x + y) % 2 == 0], y[(x + y) % 2 == 0]))
        self._numbers = ((squares[:, None] << np.uint64(12)) + np.arange(4096, dtype=np.uint64)).reshape(-1)[:count]
        size_m = 64 * side * BLOCK_PX * RES_M
        self.box: Box = ((0.0, 0.0, 0.0), (size_m, size_m, 1.0))

    def occupied(self, frame: _core.Frame, level: int, within: tuple[int, NDArray[np.uint32]] | None = None) -> Numbers:
        return self._numbers

    def block_keys(self, frame: _core.Frame, z: int, blocks: NDArray[np.uint32]) -> list[str]:
        return [f"{x:016x}{y:016x}" for x, y in blocks.tolist()]


def measure(sizes: Iterable[int] = SIZES) -> list[dict[str, Any]]:
    """Measures and prints the table."""
    rows = [row for what in _MEASURES for size in sizes for row in _in_process(what, size)]
    table = Table(title="planning, one view", title_justify="left")
    for column in ("", "base blocks", "jobs", "s", "CPU s", "CPU µs a job", "MB before", "MB at most"):
        table.add_column(column, justify="right" if column else "left")
    for row in rows:
        sizes_mb = f"{row.start_bytes / 1e6:.0f}", f"{row.peak_bytes / 1e6:.0f}"
        table.add_row(
            row.what,
            f"{row.base_blocks:,}",
            f"{row.jobs:,}",
            f"{row.seconds:.1f}",
            f"{row.cpu_s:.1f}",
            f"{1e6 * row.cpu_s / row.jobs:.1f}",
            *sizes_mb,
        )
    Console(width=160).print(table)
    return [asdict(row) for row in rows]


def measure_jobs(count: int) -> list[PlanningRow]:
    scene = SyntheticScene(count)
    return [_plan("jobs", scene, _record(scene.box, ViewAngles(0, 90)), count)]


def measure_core(count: int) -> list[PlanningRow]:
    with tempfile.TemporaryDirectory() as folder:
        workspace = Workspace(Path(folder)).create()
        side_m = count**0.5 * BLOCK_PX * RES_M
        (Path(folder) / "town.obj").write_text(_houses(side_m))
        for command in (["create-scene", "town", "--ground-plane", "on"], ["add-files", "town", str(Path(folder) / "town.obj"), "--split", "group"]):
            if app.run([*command, "-w", folder]):
                raise SystemExit(f"bench: {command} failed")
        catalogue = workspace.open_catalogue()
        build(workspace, catalogue, "town", threads=2, max_memory_bytes=BUILD_BYTES)
        catalogue.close()
        scene = open_scene(workspace, "town")
        record = _record(scene.box, ViewAngles(0, 90))
        planned = _plan("core", scene, record, count)
        return [planned, _announce(scene, record, planned)]


def measure_catalogue(count: int) -> list[PlanningRow]:
    scene = SyntheticScene(count)
    with tempfile.TemporaryDirectory() as folder:
        catalogue = Workspace(Path(folder)).create().open_catalogue()
        catalogue.create_scene(SceneRecord("town"))
        record = _record(scene.box, ViewAngles(0, 90))
        catalogue.create_rendering(record)
        rows = []
        for what in ("catalogue, new", "catalogue, unchanged"):
            start, begun, cpu = _peak(), time.perf_counter(), time.process_time()
            known = {record.tracks[0].id: numbers_of((job.block.x, job.block.y) for job in catalogue.jobs("r") if job.kind == "base")}
            counts = catalogue.plan("r", plan_jobs(scene, record, known))
            spent = time.perf_counter() - begun, time.process_time() - cpu
            rows.append(PlanningRow(what, count, counts.added + counts.kept, *spent, start, _peak()))
        catalogue.close()
    return rows


def _plan(what: str, scene: PlannedScene, record: RenderingRecord, count: int) -> PlanningRow:
    start, begun, cpu = _peak(), time.perf_counter(), time.process_time()
    base, jobs = 0, 0
    job: PlannedJob
    for job in plan_jobs(scene, record, {}):
        base += job.kind == "base"
        jobs += 1
    if base < 0.9 * count:
        raise SystemExit(f"bench: planned {base} base blocks instead of {count}")
    return PlanningRow(what, base, jobs, time.perf_counter() - begun, time.process_time() - cpu, start, _peak())


def _announce(scene: PlannedScene, record: RenderingRecord, planned: PlanningRow) -> PlanningRow:
    start, begun, cpu = _peak(), time.perf_counter(), time.process_time()
    planned_occupancy(scene, record.frames[0]).encode()
    spent = time.perf_counter() - begun, time.process_time() - cpu
    return PlanningRow("core, announced", planned.base_blocks, planned.jobs, *spent, start, _peak())


def _record(box: Box, view: ViewAngles) -> RenderingRecord:
    frames = pin(box, 256, RES_M, (view,))
    return RenderingRecord("r", "town", RES_M, (LAYERS,), frames, box)


def _houses(side_m: float) -> str:
    lines, step_m = [], side_m / HOUSES
    corners = [(dx, dy, z) for z in (0, 8) for dy in (0, 10) for dx in (0, 10)]
    faces = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (2, 4, 8, 6), (4, 3, 7, 8), (3, 1, 5, 7)]
    for number in range(HOUSES**2):
        x, y = number % HOUSES * step_m, number // HOUSES * step_m
        lines += [f"g house-{number}", *(f"v {x + dx:.2f} {y + dy:.2f} {z}" for dx, dy, z in corners)]
        lines += ["f " + " ".join(str(8 * number + corner) for corner in face) for face in faces]
    return "\n".join(lines) + "\n"


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


_MEASURES: Mapping[str, Any] = {"jobs": measure_jobs, "core": measure_core, "catalogue": measure_catalogue}


def _in_process(what: str, size: int) -> list[PlanningRow]:
    command = [sys.executable, "-m", "bench.planning", what, str(size)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"bench: {' '.join(command)}: {done.stderr}")
    return [PlanningRow(**row) for row in json.loads(done.stdout.splitlines()[-1])]


if __name__ == "__main__":
    print(json.dumps([asdict(row) for row in _MEASURES[sys.argv[1]](int(sys.argv[2]))]))
