"""Renderings of a window: the tiles equal those of the whole scene, and all commands work."""

import json
from pathlib import Path

import numpy as np
import pytest

from map3d.catalogue import Workspace
from map3d.tiles.manifest import Manifest
from map3d.tiles.sqlite_store import SqliteTileStore
from tests.cli.towns import Run, house, write_town

core = pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole

RES = 0.0625
TILE_M = 256 * RES
WINDOW_M = 64.0
VIEWS = ("--view", "0/30", "--view", "90/30", "--view", "0/90")
"""sin 30° is exactly one half, so ground points 32 m apart are whole tiles apart in each of these views."""


@pytest.fixture
def scene(run: Run, tmp_path: Path) -> Workspace:
    assert run("create-scene", "town", "--ground-plane", "off")[0] == 0
    status, _, err = run("add-files", "town", str(write_town(tmp_path / "files")))
    assert status == 0, err
    return Workspace(tmp_path / "workspace")


def rendered(run: Run, workspace: Workspace, name: str, *options: str) -> Manifest:
    for words in (("create-rendering", "town", name, "--res", str(RES), *VIEWS, *options), ("render", name)):
        status, _, err = run(*words)
        assert status == 0, err
    return Manifest.load(workspace.manifest_path(name).read_bytes())


def window_of(whole: Manifest, dx: float, dy: float, size_m: float = WINDOW_M) -> str:
    """Returns a window shifted from the centre of the scene, in the scene's CRS."""
    middle = (np.array(whole.box[0]) + whole.box[1]) / 2 + whole.origin
    return f"{middle[0] + dx!r},{middle[1] + dy!r},{size_m}".replace("np.float64(", "").replace(")", "")


def base_tiles(workspace: Workspace, manifest: Manifest, view: str, layer: int) -> dict[tuple[int, int], bytes]:
    with SqliteTileStore(workspace.store_path(manifest.name, view), read_only=True) as store:
        tiles = [tile for tile in store.list_tiles(layer) if tile.z == manifest.zmax]
        return {(tile.x, tile.y): store.get_tile(layer, *tile) or b"" for tile in tiles}


def test_tiles_in_a_window_equal_those_of_the_whole_rendering(run: Run, scene: Workspace) -> None:
    whole = rendered(run, scene, "whole")
    part = rendered(run, scene, "part", "--window", window_of(whole, 32, 32))
    assert (part.zmax, part.views[0].frame.size_m) == (2, WINDOW_M)
    for view in part.views:
        frame, beside = view.frame, whole.view(view.frame.id)
        assert beside is not None
        assert frame.d0_m == beside.frame.d0_m
        across, down = (frame.u0_m - beside.frame.u0_m) / TILE_M, (beside.frame.v0_m - frame.v0_m) / TILE_M
        assert (across, down) == (int(across), int(down))
        for layer in range(len(part.layers)):
            ours = base_tiles(scene, part, frame.id, layer)
            theirs = {(x - int(across), y - int(down)): data for (x, y), data in base_tiles(scene, whole, frame.id, layer).items()}
            assert len(ours) >= 4
            assert ours == {place: data for place, data in theirs.items() if 0 <= place[0] < 4 and 0 <= place[1] < 4}


def test_window_can_be_verified_published_and_estimated(run: Run, scene: Workspace, tmp_path: Path) -> None:
    whole = rendered(run, scene, "whole")
    part = rendered(run, scene, "part", "--window", window_of(whole, 32, 32))
    assert run("verify", "part")[0] == 0
    status, out, err = run("estimate", "part", "--json")
    assert status == 0, err
    assert json.loads(out)["base_tiles"] == sum(view.occupancy.count(part.zmax) for view in part.views)
    status, _, err = run("publish", "part", "-o", str(tmp_path / "folder"))
    assert status == 0, err
    published = json.loads((tmp_path / "folder" / "rendering.json").read_text())
    middle = (np.array(whole.box[0]) + whole.box[1]) / 2
    assert published["start"]["local"] == pytest.approx([middle[0] + 32, middle[1] + 32, middle[2]])
    assert run("verify", "--published", str(tmp_path / "folder"))[0] == 0


def test_window_inside_the_scene_is_filled_completely(run: Run, tmp_path: Path) -> None:
    """A floor of 400 m at pitch 45: every base tile of a window of 256 m has content."""
    (tmp_path / "floor.obj").write_text("v 0 0 0\nv 400 0 0\nv 400 400 0\nv 0 400 0\nf 1 2 3 4\n")
    assert run("create-scene", "town", "--ground-plane", "off")[0] == 0
    assert run("add-files", "town", str(tmp_path / "floor.obj"))[0] == 0
    for words in (("create-rendering", "town", "floor", "--res", "0.25", "--view", "0/45", "--window", "200,200,256"), ("render", "floor")):
        status, _, err = run(*words)
        assert status == 0, err
    manifest = Manifest.load(Workspace(tmp_path / "workspace").manifest_path("floor").read_bytes())
    assert manifest.views[0].occupancy.count() == 1 + 4 + 16


def test_only_content_added_inside_the_window_changes_tiles(run: Run, scene: Workspace, tmp_path: Path) -> None:
    part = rendered(run, scene, "part", "--window", "20,20,64")
    before = {view.frame.id: base_tiles(scene, part, view.frame.id, 0) for view in part.views}
    for name, x, y in (("far", 3000.0, 20.0), ("near", 20.0, 20.0)):
        (tmp_path / f"{name}.obj").write_text(house(x, y, 9.0))
        assert run("add-files", "town", str(tmp_path / f"{name}.obj"))[0] == 0
        status, _, err = run("render", "part")
        assert status == 0, err
        after = {view.frame.id: base_tiles(scene, part, view.frame.id, 0) for view in part.views}
        assert (after == before) == (name == "far")


def test_window_with_levels_keeps_its_side(run: Run, scene: Workspace) -> None:
    status, out, err = run("create-rendering", "town", "part", "--levels", "3", "--window", "60,60,77.7", "--json")
    assert status == 0, err
    record = json.loads(out)
    assert {frame["size_m"] for frame in record["frames"]} == {77.7}
    assert record["options"]["window"]["size_m"] == 77.7


@pytest.mark.parametrize(
    ("window", "says"),
    [("1,2", "X,Y,SIZE"), ("a,b,c", "X,Y,SIZE"), ("60,60,0", "positive"), ("60,60,nan", "positive"), ("9000,60,64", "does not meet the scene")],
)
def test_invalid_windows_are_refused(run: Run, scene: Workspace, window: str, says: str) -> None:
    status, _, err = run("create-rendering", "town", "part", "--res", "0.25", "--window", window)
    assert status == 2
    assert says in err.splitlines()[-1]
