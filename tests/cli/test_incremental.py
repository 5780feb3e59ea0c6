"""Incremental rendering: only affected blocks are rendered again, and the tiles equal those of a render from scratch."""

import json
import shutil
import sqlite3
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.geometry.frames import PinnedFrame
from map3d.registry import Registry
from map3d.tiles.naming import block_levels
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import Box, TileId
from tests.cli.test_whole import digest
from tests.cli.towns import Run, copy_original, house, make_original, write_town

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole

VIEWS = ("--view", "0/45", "--view", "90/30")
Blocks = dict[tuple[str, str], str]


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("original")
    files = write_town(folder / "files")
    (files / "ground.obj").write_text("v -60 -60 -1\nv 190 -60 -1\nv 190 190 -1\nv -60 190 -1\nf 1 2 3 4\n")
    return make_original(
        folder,
        ("create-scene", "town"),
        ("add-files", "town", str(files)),
        ("create-rendering", "town", "view", "--res", "0.05", *VIEWS),
        ("render", "view"),
    )


@pytest.fixture
def town(original: Path, tmp_path: Path) -> Workspace:
    """A complete rendering `view` of the scene `town`: one file per house, and one for the ground."""
    return copy_original(original, tmp_path)


def keys(workspace: Workspace) -> Blocks:
    """Returns (view, block) → key of the stored base blocks."""
    found = {}
    for path in workspace.rendering_folder("view").glob("*.sqlite"):
        with SqliteTileStore(path, read_only=True) as store:
            root = block_levels(store.shape.zmax)[0].root
            found.update({(path.stem, str(block.id)): block.key for block in store.list_blocks() if block.id.z == root})
    return found


def blocks_seeing(workspace: Workspace, box: Box) -> set[tuple[str, str]]:
    """Returns the base blocks whose beam intersects or touches a local box."""
    catalogue = workspace.open_catalogue()
    frames = catalogue.rendering("view").frames
    catalogue.close()
    return {(frame.id, name) for frame in frames for name in _blocks_seeing(frame, box)}


def _blocks_seeing(frame: PinnedFrame, box: Box) -> list[str]:
    root = block_levels(frame.zmax)[0].root
    corners = [(x, y, z) for x in (box[0][0], box[1][0]) for y in (box[0][1], box[1][1]) for z in (box[0][2], box[1][2])]
    i, j, _ = frame.level_pixel_from_local(root, corners)
    columns, rows = i / frame.tile_px, j / frame.tile_px
    last = 2**root - 1
    first = [max(int(values.min() - 0.01), 0) for values in (columns, rows)]
    end = [min(int(values.max() + 0.01), last) for values in (columns, rows)]
    return [f"{root}/{x}/{y}" for x in range(first[0], end[0] + 1) for y in range(first[1], end[1] + 1)]


def box_of(workspace: Workspace, name: str) -> Box:
    with Registry(workspace.registry_path("town")) as registry:
        (box,) = (item.box for item in registry.objects() if item.asset == name and item.box is not None)
    return box


def render_from_scratch(run: Run, workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Builds and renders the same registry and frames in a workspace without chunks and tiles; returns the digests."""
    copy = workspace.root.with_name("again")
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(workspace.root, copy)
    again = Workspace(copy)
    shutil.rmtree(copy / "renderings")
    for name in ("chunks", "textures", "build"):
        shutil.rmtree(again.scene_folder("town") / name, ignore_errors=True)
    (again.scene_folder("town") / "scene.json").unlink()
    with sqlite3.connect(copy / "catalogue.sqlite") as db:
        db.execute("DELETE FROM job")
        db.execute("UPDATE scene SET built = NULL")
    assert run("render", "view", "-w", str(copy))[0] == 0
    return digest(again)


def render(run: Run) -> int:
    """Renders and returns the number of jobs done."""
    status, out, err = run("render", "view", "--json")
    assert status == 0, err
    return int(json.loads(out)["statistics"]["done"])


def test_changed_added_or_removed_house_renders_only_affected_blocks_and_equals_a_render_from_scratch(
    run: Run, town: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = keys(town)
    old = box_of(town, "house-1-1")
    path = tmp_path / "files" / "house-1-1.obj"
    path.write_text(house(43.0, 40.0, 9.5))
    assert run("add-files", "town", str(path))[0] == 0
    assert render(run) > 0
    after = keys(town)
    changed = {place for place in after if before.get(place) != after[place]}
    assert changed <= blocks_seeing(town, old) | blocks_seeing(town, box_of(town, "house-1-1"))
    assert 0 < len(changed) < len(after) / 2
    assert digest(town) == render_from_scratch(run, town, monkeypatch)
    # One file with two houses; then one of them is removed.
    path.write_text("o a\n" + house(43.0, 40.0, 9.5) + "o b\n" + _shifted(house(60.0, 62.0, 4.0)))
    assert run("add-files", "town", str(path), "--split", "group")[0] == 0
    assert render(run) > 0
    assert digest(town) == render_from_scratch(run, town, monkeypatch)
    path.write_text("o a\n" + house(43.0, 40.0, 9.5))
    assert run("add-files", "town", str(path), "--split", "group")[0] == 0
    assert render(run) > 0
    assert digest(town) == render_from_scratch(run, town, monkeypatch)


def _shifted(text: str) -> str:
    """Returns the house with relative vertex indices, for a second house in a file."""
    return (
        text.replace("f 1 3 4 2", "f -8 -6 -5 -7")
        .replace("f 5 6 8 7", "f -4 -3 -1 -2")
        .replace("f 1 2 6 5", "f -8 -7 -3 -4")
        .replace("f 2 4 8 6", "f -7 -5 -1 -3")
        .replace("f 4 3 7 8", "f -5 -6 -2 -1")
        .replace("f 3 1 5 7", "f -6 -8 -4 -2")
    )


def test_unchanged_scene_or_file_renders_nothing(run: Run, town: Workspace, tmp_path: Path) -> None:
    before, tiles = keys(town), digest(town)
    assert render(run) == 0
    assert run("add-files", "town", str(tmp_path / "files" / "house-2-1.obj"))[0] == 0
    assert render(run) == 0
    assert (keys(town), digest(town)) == (before, tiles)


def test_added_view_is_rendered_alone_and_equals_one_created_at_first(run: Run, town: Workspace) -> None:
    before, tiles = keys(town), digest(town)
    status, _, err = run("add-views", "view", "--view", "200/60")
    assert status == 0, err
    assert run("add-views", "view", "--view", "0/45")[0] == 2
    done = render(run)
    after = keys(town)
    assert {place: after[place] for place in before} == before
    assert {name: digest(town)[name] for name in tiles} == tiles
    assert done < len(after)
    assert run("create-rendering", "town", "whole", "--res", "0.05", *VIEWS, "--view", "200/60")[0] == 0
    assert run("render", "whole")[0] == 0
    assert digest(town, "whole") == digest(town)
    assert run("verify")[0] == 0


def test_added_layers_are_rendered_alone_and_equal_those_created_at_first(run: Run, town: Workspace) -> None:
    assert run("create-rendering", "town", "less", "--res", "0.05", *VIEWS, "--layers", "color")[0] == 0
    assert run("render", "less")[0] == 0
    before = contents(town, "less")
    whole = json.loads(run("estimate", "less", "--json")[1])
    status, _, err = run("add-layers", "less", "--layers", "data")
    assert status == 0, err
    assert run("add-layers", "less", "--layers", "data")[0] == 2
    assert contents(town, "less") == before, "nothing is rendered yet"
    status, out, _ = run("verify", "less")
    assert (status, "0-45+1" in out, "no job" in out, "only one of" in out) == (1, True, True, False)
    more = json.loads(run("estimate", "less", "--json")[1])
    assert (more["base_tiles"], more["images"]) == (whole["base_tiles"], whole["images"] * 2)
    assert 0 < more["open_tiles"] <= more["base_tiles"]
    assert more["bytes"] > whole["bytes"]
    status, out, err = run("render", "less", "--json")
    assert (status, json.loads(out)["statistics"]["done"]) == (0, len({(track, block) for track, block, *_ in before if block})), err
    after = contents(town, "less")
    assert {place: after[place] for place in before} == before
    # Compare with a rendering that had all layers from the start.
    assert run("verify", "less")[0] == 0
    assert layers_of(town, "less") == layers_of(town, "view")
    assert run("add-views", "less", "--view", "200/60")[0] == 0
    assert run("add-views", "view", "--view", "200/60")[0] == 0
    assert run("render", "less")[0] == run("render", "view")[0] == 0
    assert layers_of(town, "less") == layers_of(town, "view")
    assert len(list(town.rendering_folder("less").glob("*+1.sqlite"))) == 3
    assert run("verify", "less")[0] == 0
    with sqlite3.connect(town.store_path("less", "0-45+1")) as db:
        db.execute("DELETE FROM tile WHERE (z, x, y) IN (SELECT z, x, y FROM tile ORDER BY z DESC LIMIT 1)")
    status, out, _ = run("verify", "less")
    assert (status, "exists in only one of the tracks 0-45 and 0-45+1" in out) == (1, True)
    # After --regrid they are one pass.
    assert run("create-rendering", "town", "less", "--res", "0.05", *VIEWS, "--regrid")[0] == 0
    assert run("render", "less")[0] == 0
    assert not list(town.rendering_folder("less").glob("*+1.sqlite"))
    assert digest(town, "less").keys() == {"0-45.sqlite", "90-30.sqlite"}


def contents(workspace: Workspace, rendering: str) -> dict[tuple[object, ...], object]:
    """Returns the contents of the stores: tiles with their bytes, blocks with key, version and seam."""
    found: dict[tuple[object, ...], object] = {}
    for path in workspace.rendering_folder(rendering).glob("*.sqlite"):
        with SqliteTileStore(path, read_only=True) as store:
            found.update({(path.stem, str(block.id)): (block, store.get_seam(block.id)) for block in store.list_blocks()})
            for layer in range(len(store.shape.layers)):
                found.update({(path.stem, "", layer, tile): store.get_tile(layer, *tile) for tile in store.list_tiles(layer)})
    return found


def layers_of(workspace: Workspace, rendering: str) -> dict[tuple[str, str], dict[TileId, bytes | None]]:
    """Returns (view, layer) → tiles, from all tracks."""
    found = {}
    for path in workspace.rendering_folder(rendering).glob("*.sqlite"):
        with SqliteTileStore(path, read_only=True) as store:
            for number, layer in enumerate(store.shape.layers):
                found[path.stem.partition("+")[0], layer.name] = {tile: store.get_tile(number, *tile) for tile in store.list_tiles(number)}
    return found


def test_estimate_counts_blocks_that_a_change_affects(run: Run, town: Workspace, tmp_path: Path) -> None:
    whole = json.loads(run("estimate", "view", "--json")[1])
    assert whole["open_tiles"] == 0
    path = tmp_path / "files" / "house-3-0.obj"
    path.write_text(house(120.0, 0.0, 9.0))
    assert run("add-files", "town", str(path))[0] == 0
    status, out, err = run("estimate", "view", "--json")
    assert status == 0, err
    assert 0 < json.loads(out)["open_tiles"] < whole["base_tiles"] / 2
    assert render(run) > 0
    assert json.loads(run("estimate", "view", "--json")[1])["open_tiles"] == 0
