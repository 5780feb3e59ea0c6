"""Memory of planning, estimates and manifests grows with the content, even at levels whose full grid would not fit in memory."""

import json
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d import _core
from map3d.catalogue import RenderingRecord, Workspace
from map3d.cli.app import run
from map3d.geometry.frames import pin
from map3d.renderings.plan import plan_jobs, planned_occupancy
from map3d.tiles.manifest import Manifest
from map3d.tiles.naming import block_levels
from map3d.tiles.occupancy import Occupancy, numbers_of, xy_from_morton
from map3d.types import DEEPEST_LEVEL, Layer, ViewAngles
from tests.core.built import House, build_houses

LAYERS = (Layer("color", "color", "webp", 80), Layer("ao", "ao", "png", radius_m=20.0))
MOST_BYTES = 400 << 20
LINE_M = 100_000.0


def line_of_houses(count: int, side_m: float = 10.0) -> list[House]:
    """Returns houses along a diagonal line of 100 km."""
    step_m = LINE_M / 2**0.5 / (count - 1)
    return [(k * step_m, k * step_m, side_m, 6.0) for k in range(count)]


def record(scene: _core.Scene, res_m: float, *views: ViewAngles) -> RenderingRecord:
    return RenderingRecord("r", "line", res_m, (LAYERS,), tuple(pin(scene.box, 256, res_m, views)), scene.box)


def plan_a_line(folder: str) -> dict[str, object]:
    """Plans 1,000 houses at 0.1 m in two views; returns facts about the plan and the memory that it took."""
    scene = build_houses(Path(folder), line_of_houses(1000))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    rendering = record(scene, 0.1, ViewAngles(0, 45), ViewAngles(30, 22.5))
    jobs = list(plan_jobs(scene, rendering, {}))
    plans = [planned_occupancy(scene, frame) for frame in rendering.frames]
    text = [plan.encode() for plan in plans]
    read_back = [Occupancy.decode(rendering.zmax, one) == plan for one, plan in zip(text, plans, strict=True)]
    grown_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    return {"zmax": rendering.zmax, "jobs": len(jobs), "tiles": [plan.count(rendering.zmax) for plan in plans], "same": read_back, "kib": grown_kib}


def test_a_line_of_100_km_is_planned_at_a_decimetre_in_little_memory(tmp_path: Path) -> None:
    program = f"import json, tests.renderings.test_deep_levels as t; print(json.dumps(t.plan_a_line({str(tmp_path)!r})))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=120, cwd=Path(__file__).parents[2])
    facts = json.loads(done.stdout)
    assert facts["zmax"] == 13
    assert facts["same"] == [True, True]
    assert facts["jobs"] > 1000, "a base block of 205 m holds two or three houses"
    for tiles in facts["tiles"]:
        assert 1000 <= tiles <= 9 * 1000, "a house of 10 m meets 1 to 9 tiles of 25.6 m"
    assert facts["kib"] * 1024 < MOST_BYTES / 4


@pytest.mark.parametrize(("res_m", "zmax"), [(0.0005, 20), (0.00001, DEEPEST_LEVEL)])
def test_planning_reaches_the_deepest_level(tmp_path: Path, res_m: float, zmax: int) -> None:
    side_m = 256 * res_m * 8
    scene = build_houses(tmp_path, line_of_houses(3, side_m))
    rendering = record(scene, res_m, ViewAngles(0, 90))
    assert rendering.zmax == zmax
    (frame,) = rendering.frames
    plan = planned_occupancy(scene, frame)
    assert 3 * 8**2 <= plan.count(zmax) <= 3 * 10**2, "a roof of 8 × 8 tiles meets at most 10 × 10"
    root = block_levels(zmax)[0].root
    jobs = list(plan_jobs(scene, rendering, {}))
    blocks = [job.block for job in jobs if job.kind == "base"]
    assert {(tile.x, tile.y) for tile in plan.tiles(root)} <= {(block.x, block.y) for block in blocks}
    assert planned_occupancy(scene, frame, within=numbers_of((block.x, block.y) for block in blocks)) == plan
    assert len({job.key for job in jobs}) == len(jobs)
    assert Occupancy.decode(zmax, plan.encode()) == plan


def test_occupied_tiles_are_sorted_morton_numbers(tmp_path: Path) -> None:
    scene = build_houses(tmp_path, line_of_houses(50))
    (frame,) = record(scene, 10.0, ViewAngles(45, 45)).frames
    numbers = scene.occupied(_core.Frame(**{**frame.to_json(), "layers": []}), frame.zmax)
    assert numbers.dtype == np.uint64
    assert (np.diff(numbers.astype(np.int64)) > 0).all()
    assert all((axis < 2**frame.zmax).all() for axis in xy_from_morton(numbers))


def test_a_rendering_of_21_levels_is_estimated_rendered_and_verified(tmp_path: Path) -> None:
    corners = [(x + dx, y + dy, 3.0) for x, y in ((0.0, 0.0), (70_000.0, 70_000.0)) for dx, dy in ((0, 0), (0.05, 0), (0, 0.05))]
    faces = "o a\nf 1 2 3\no b\nf 4 5 6\n"
    (tmp_path / "far.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + faces)
    where = ["-w", str(tmp_path / "workspace")]
    for command in (
        ["create-scene", "line", "--crs", "local", "--ground-plane", "off", *where],
        ["add-files", "line", str(tmp_path / "far.obj"), *where],
        ["create-rendering", "line", "r", "--keep-outliers", "--levels", "21", "--view", "0-90", "--layers", "color,id,depth", *where],
        ["estimate", "r", "--workers", "1", *where],
        ["render", "r", "--workers", "1", *where],
        ["verify", *where],
    ):
        assert run(command) == 0, command
    workspace = Workspace(tmp_path / "workspace")
    manifest = Manifest.load(workspace.manifest_path("r").read_bytes())
    assert (manifest.zmax, manifest.complete) == (20, True)
    occupancy = manifest.views[0].occupancy
    assert 2 <= occupancy.count(20) <= 8
    assert occupancy.count() == sum(occupancy.count(z) for z in range(21)) <= 21 * 8
