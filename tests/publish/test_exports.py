"""Exports, read by other software: GDAL's MBTiles driver and independent readers of the folders."""

import hashlib
import math
import sqlite3
import xml.etree.ElementTree as ElementTree
from io import BytesIO

import pytest
import rasterio
from PIL import Image

from map3d.cli.app import run
from map3d.errors import AlreadyExists, BadRequest, Corrupt, NotFound, Stopped
from map3d.publish.exports import export
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId, TileId
from tests.web.workspaces import OCCUPIED, ZMAX, every_tile, put_block, tile_bytes

VIEW = "45-22.5"
NAMES = {"mbtiles": "a.mbtiles", "xyz": "a", "dzi": "a.dzi"}
NAMESPACE = "{http://schemas.microsoft.com/deepzoom/2008}"


def expected(layer="color"):
    return {tuple(tile): tile_bytes(VIEW, layer, tile) for tile in every_tile()}


def contents(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def read_mbtiles(path):
    db = sqlite3.connect(path)
    tiles = {(z, x, (1 << z) - 1 - row): data for z, x, row, data in db.execute("SELECT zoom_level, tile_column, tile_row, tile_data FROM tiles")}
    metadata = dict(db.execute("SELECT name, value FROM metadata"))
    db.close()
    return tiles, metadata


@pytest.mark.parametrize("layer", ["color", "id"])
def test_mbtiles_has_every_tile_counted_from_the_bottom(workspace, tmp_path, layer):
    path = tmp_path / "a.mbtiles"
    done = export(workspace, "tea", path, to="mbtiles", view=VIEW, layer=layer)
    tiles, metadata = read_mbtiles(path)
    assert tiles == expected(layer)
    assert (done.tiles, done.bytes) == (len(tiles), sum(map(len, tiles.values())))
    assert (metadata["minzoom"], metadata["maxzoom"], metadata["format"]) == ("0", str(ZMAX), "webp" if layer == "color" else "png")
    assert "bounds" not in metadata
    assert "not on the globe" in metadata["description"]
    assert metadata["attribution"] == "© City of Tea"


def test_gdal_reads_mbtiles(workspace, tmp_path):
    path = tmp_path / "a.mbtiles"
    export(workspace, "tea", path, to="mbtiles", view=VIEW)
    with rasterio.open(path) as opened:
        assert opened.driver == "MBTiles"
        side = 256 << ZMAX
        assert (opened.width, opened.height) == (side, side)
        for x, y in ((0, 0), (15, 15), (2, 3)):
            pixels = opened.read([1, 2, 3], window=((y * 256, y * 256 + 256), (x * 256, x * 256 + 256)))
            assert (pixels.mean(axis=(1, 2)) == (200, 120, 60)).all()


def test_a_folder_has_every_tile(workspace, tmp_path):
    export(workspace, "tea", tmp_path / "a", to="xyz", view=VIEW)
    assert contents(tmp_path / "a") == {f"{z}/{x}/{y}.webp": data for (z, x, y), data in expected().items()}


def test_a_deep_zoom_image_has_every_level_from_1_px(workspace, tmp_path):
    export(workspace, "tea", tmp_path / "a.dzi", to="dzi", view=VIEW)
    image = ElementTree.fromstring((tmp_path / "a.dzi").read_text())
    size = image.find(f"{NAMESPACE}Size")
    side, tile_px = int(size.attrib["Width"]), int(image.attrib["TileSize"])
    assert (side, tile_px, image.attrib["Overlap"], image.attrib["Format"]) == (256 << ZMAX, 256, "0", "webp")
    last = math.ceil(math.log2(side))
    files = contents(tmp_path / "a_files")
    for level in range(last + 1):
        level_px = math.ceil(side / 2 ** (last - level))
        count = math.ceil(level_px / tile_px)
        z = level - 8
        there = {name: data for name, data in files.items() if name.startswith(f"{level}/")}
        if z >= 0:
            assert there == {f"{level}/{x}_{y}.webp": data for (at, x, y), data in expected().items() if at == z}
            assert all(int(part) < count for name in there for part in name.split("/")[1].split(".")[0].split("_"))
        else:
            with Image.open(BytesIO(there[f"{level}/0_0.webp"])) as small:
                assert small.size == (level_px, level_px)
    assert len(files) == len(expected()) + 8
    for tile in every_tile():
        assert is_shown(image, 8 + tile.z, tile, side, last)


def is_shown(image, level, tile, side, last):
    """Whether a viewer asks for the tile: as OpenSeadragon, it does if a DisplayRect of the level overlaps it."""
    scale = 2 ** (last - level)
    for shown in image.iter(f"{NAMESPACE}DisplayRect"):
        rect = {name: int(value) / scale / 256 for name, value in shown.find(f"{NAMESPACE}Rect").attrib.items()}
        inside = rect["X"] <= tile.x < rect["X"] + rect["Width"] and rect["Y"] <= tile.y < rect["Y"] + rect["Height"]
        if int(shown.attrib["MinLevel"]) <= level <= int(shown.attrib["MaxLevel"]) and inside:
            return True
    return False


@pytest.mark.parametrize("to", NAMES)
def test_a_stopped_export_leaves_nothing_at_its_place_and_resumes(workspace, tmp_path, monkeypatch, to):
    monkeypatch.setattr("map3d.publish.exports.TILES_PER_STEP", 3)
    out = tmp_path / "exported" / NAMES[to]
    with pytest.raises(Stopped):
        export(workspace, "tea", out, to=to, view=VIEW, progress=lambda done, total: done < 9)
    assert not out.exists()
    assert not out.with_name("a_files").exists()
    export(workspace, "tea", out, to=to, view=VIEW)
    export(workspace, "tea", tmp_path / "reference" / NAMES[to], to=to, view=VIEW)
    assert contents(tmp_path / "exported") == contents(tmp_path / "reference")


def test_files_of_a_stopped_export_of_other_tiles_are_dropped(workspace, tmp_path, monkeypatch):
    monkeypatch.setattr("map3d.publish.exports.TILES_PER_STEP", 3)
    with pytest.raises(Stopped):
        export(workspace, "tea", tmp_path / "a", to="xyz", view="0-45", progress=lambda done, total: done < 9)
    render_again(workspace)
    export(workspace, "tea", tmp_path / "a", to="xyz", view="0-45")
    assert contents(tmp_path / "a") != {}
    with SqliteTileStore(workspace.store_path("tea", "0-45"), read_only=True) as store:
        for name, data in contents(tmp_path / "a").items():
            z, x, y = map(int, name.removesuffix(".webp").split("/"))
            assert data == store.get_tile(0, z, x, y)


def render_again(workspace):
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        put_block(store, "0-45", BlockId(1, 0, 0), Occupancy.from_tiles(ZMAX, OCCUPIED), version=2, salt="new")


@pytest.mark.parametrize("to", NAMES)
def test_tiles_that_change_during_an_export_are_detected(workspace, tmp_path, monkeypatch, to):
    monkeypatch.setattr("map3d.publish.exports.TILES_PER_STEP", 3)
    with pytest.raises(Corrupt, match="changed"):
        export(workspace, "tea", tmp_path / NAMES[to], to=to, view="0-45", progress=lambda done, total: render_again(workspace) or True)
    assert not (tmp_path / NAMES[to]).exists()


@pytest.mark.parametrize("to", NAMES)
def test_existing_files_are_not_replaced(workspace, tmp_path, to):
    out = tmp_path / NAMES[to]
    export(workspace, "tea", out, to=to, view=VIEW)
    before = contents(tmp_path)
    with pytest.raises(AlreadyExists):
        export(workspace, "tea", out, to=to, view=VIEW)
    assert {name: hashlib.sha256(data).hexdigest() for name, data in contents(tmp_path).items()} == {
        name: hashlib.sha256(data).hexdigest() for name, data in before.items()
    }


def test_unknown_views_layers_and_names_are_refused(workspace, tmp_path):
    with pytest.raises(NotFound, match=r"its views are 0-45, 45-22\.5"):
        export(workspace, "tea", tmp_path / "a", to="xyz", view="90-45")
    with pytest.raises(NotFound, match="its layers are color, normal, id, depth"):
        export(workspace, "tea", tmp_path / "a", to="xyz", view=VIEW, layer="sun")
    with pytest.raises(BadRequest, match=r"\.dzi"):
        export(workspace, "tea", tmp_path / "a", to="dzi", view=VIEW)


def test_the_command_line_exports(workspace, tmp_path, capsys):
    assert run(["export", "tea", "--to", "xyz", "--view", "45/22.5", "-o", str(tmp_path / "a"), "-w", str(workspace.root)]) == 0
    assert f"{len(every_tile())} tiles" in capsys.readouterr().out
    assert (tmp_path / "a" / "0" / "0" / "0.webp").read_bytes() == tile_bytes(VIEW, "color", TileId(0, 0, 0))
