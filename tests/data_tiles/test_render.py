"""Rendering with data tiles: the same pixels as with PNG layers, in every path of a rendering."""

import json
import re
from contextlib import closing
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from map3d import _core
from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.tiles.decode_tile import decode_tile, find_layer
from map3d.types import DATA_TILE_KINDS
from tests.cli.towns import house
from tests.data_tiles.towns import KINDS, RES_M, VIEW, damage, manifest_of, record_of, stored_tiles

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole


def test_data_tiles_have_the_pixels_of_the_png_layers(rendered: Workspace) -> None:
    record = record_of(rendered, "tile")
    assert [[layer.name for layer in layers] for layers in record.passes] == [["color", "data"], ["ao"]]
    tiles = stored_tiles(rendered, "tile", "data")
    pngs = {kind: stored_tiles(rendered, "png", kind) for kind in KINDS}
    assert len(tiles) > 20
    assert all(set(one) == set(tiles) for one in pngs.values())
    (data,) = (layer for layer in record.layers if layer.kind == "data")
    layers = {layer.kind: layer for layer in record_of(rendered, "png").layers}
    for tile, stored in tiles.items():
        found = decode_tile(data, stored, record.tile_px)
        assert set(found) == set(DATA_TILE_KINDS)
        for kind in KINDS:
            assert np.array_equal(found[kind], decode_tile(layers[kind], pngs[kind][tile], record.tile_px)[kind])
    assert stored_tiles(rendered, "tile", "color") == stored_tiles(rendered, "png", "color")
    assert stored_tiles(rendered, "tile", "ao", f"{VIEW}+1") == stored_tiles(rendered, "png", "ao", f"{VIEW}+1")


def test_data_tiles_have_a_fraction_of_the_bytes(rendered: Workspace) -> None:
    pngs = sum(len(data) for kind in KINDS for data in stored_tiles(rendered, "png", kind).values())
    assert sum(map(len, stored_tiles(rendered, "tile", "data").values())) < pngs / 2


def test_the_manifest_lists_the_data_layer(rendered: Workspace) -> None:
    png, tile = (manifest_of(rendered, name).to_json() for name in ("png", "tile"))
    assert [layer["name"] for layer in png["layers"]] == ["color", "normal", "id", "depth", "ao"]
    assert [layer["name"] for layer in tile["layers"]] == ["color", "data", "ao"]
    assert tile["layers"][1] == {
        "name": "data",
        "kind": "data",
        "format": "m3d",
        "media_type": "application/vnd.map3d.data",
        "unit_m": 0.0009765625,
    }
    jsonschema.validate(
        json.loads(rendered.manifest_path("tile").read_text()), json.loads((Path(__file__).parents[2] / "spec" / "manifest.schema.json").read_text())
    )
    assert [view["occupancy"] for view in png["views"]] == [view["occupancy"] for view in tile["views"]]


def test_verify_finds_no_fault(rendered: Workspace, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["verify", "--sample", "2", "-w", str(rendered.root)]) == 0, capfd.readouterr()


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"M3D\1" + bytes(20), "data: data tile: "),
        (b"\x89PNG\r\n\x1a\n", "data: data tile: not a data tile"),
        (None, "unregistered ids|differs"),
    ],
    ids=["no size", "other magic", "unknown id"],
)
def test_verify_reports_a_damaged_data_tile(workspace: Workspace, data: bytes | None, fault: str, capfd: pytest.CaptureFixture[str]) -> None:
    tile = damage(workspace, "tile", "data", foreign_tile() if data is None else data)
    capfd.readouterr()
    assert run(["verify", "-w", str(workspace.root)]) == 1
    output = "".join(capfd.readouterr())
    name = f"{tile.z}/{tile.x}/{tile.y}"
    lines = [line for line in output.splitlines() if name in line]
    assert lines, output
    assert any(re.search(fault, line) for line in lines), lines


def foreign_tile() -> bytes:
    """Returns a data tile with an id that no object has."""
    ids = np.full((256, 256), 4_000_000_000, np.uint32)
    return _core.encode_data_tile(np.full((256, 256, 3), (0, 0, 32767), np.int16), ids, np.full((256, 256), 7, np.uint32))


def test_layers_named_singly_are_png(workspace: Workspace) -> None:
    where = ["-w", str(workspace.root)]
    assert run(["create-rendering", "town", "mixed", "--view", VIEW, "--res", "1", "--layers", "id,color,data", *where]) == 0
    assert [(layer.name, layer.format) for layer in record_of(workspace, "mixed").layers] == [("color", "webp"), ("id", "png"), ("data", "m3d")]
    found = find_layer(record_of(workspace, "mixed").layers, "id")
    assert found is not None
    assert found[0] is found[1]


def test_layers_and_data_exclude_each_other(workspace: Workspace, capfd: pytest.CaptureFixture[str]) -> None:
    options = ["--view", VIEW, "--res", "1", "--layers", "color", "--data", "tile", "-w", str(workspace.root)]
    assert run(["create-rendering", "town", "both", *options]) == 2
    assert "either --layers or --data" in capfd.readouterr().err


def test_the_estimate_measures_data_tiles(workspace: Workspace, capfd: pytest.CaptureFixture[str]) -> None:
    where = ["-w", str(workspace.root)]
    sizes = {}
    for data in ("png", "tile"):
        for name, layers in (("color", ["--layers", "color"]), ("all", ["--data", data])):
            assert run(["create-rendering", "town", f"{name}-{data}", "--view", VIEW, "--res", RES_M, *layers, *where]) == 0
            capfd.readouterr()
            assert run(["estimate", f"{name}-{data}", "--json", *where]) == 0
            sizes[name, data] = json.loads(capfd.readouterr().out)["bytes"]
    data_bytes, png_bytes = (sizes["all", data] - sizes["color", data] for data in ("tile", "png"))
    assert 0 < data_bytes < png_bytes / 2


def test_a_changed_scene_renders_only_changed_blocks_and_equals_a_new_rendering(workspace: Workspace, tmp_path: Path) -> None:
    where = ["-w", str(workspace.root)]
    before = stored_tiles(workspace, "tile", "data")
    record = record_of(workspace, "tile")
    write_kiosk(workspace, tmp_path / "kiosk.obj")
    assert run(["add-files", "town", str(tmp_path / "kiosk.obj"), "--up", "z", *where]) == 0
    for data in ("tile", "png"):
        assert run(["render", data, *where]) == 0
    after = stored_tiles(workspace, "tile", "data")
    changed = {tile for tile in after if before.get(tile) != after[tile] and tile.z == record.zmax}
    assert 0 < len(changed) < sum(tile.z == record.zmax for tile in after) / 2
    assert run(["create-rendering", "town", "again", "--view", VIEW, "--res", RES_M, "--data", "tile", *where]) == 0
    assert run(["render", "again", *where]) == 0
    assert record_of(workspace, "again").frames == record.frames, "the content stayed in its box"
    assert stored_tiles(workspace, "again", "data") == after
    assert run(["verify", *where]) == 0


def write_kiosk(workspace: Workspace, path: Path) -> None:
    """Writes a box that hangs over the middle of the town, inside its box."""
    with closing(workspace.open_catalogue()) as catalogue:
        origin = catalogue.scene("town").origin
    assert origin is not None
    low, high = record_of(workspace, "tile").box
    x, y = (origin[axis] + (low[axis] + high[axis]) / 2 for axis in (0, 1))
    floor = origin[2] + high[2] - 8
    text = house(x, y, 6.0).replace(" 0.0\n", f" {floor}\n").replace(" 6.0\n", f" {floor + 6}\n")
    path.write_text(text)
