"""Terrain import with the compiled core: files of the asset folder (spec/scene.md)."""

import json

import numpy as np
import pytest
from pyproj import CRS

from map3d.ingest.terrain.terrain_import import import_terrain
from map3d.ingest.terrain.terrain_options import TerrainOptions
from tests.findings import skipped
from tests.ingest.terrain.rasters import NORTH, WEST, colours, hills, write

pytest.importorskip("map3d._core", reason="the compiled core is not built")


@pytest.fixture
def folder(tmp_path):
    dem, ortho = write(tmp_path / "dem.tif", hills(40, 50), 2.0), write(tmp_path / "ortho.tif", colours(400, 500), 0.2)
    report = import_terrain(dem, ortho, tmp_path / "asset", CRS.from_epsg(25832), TerrainOptions(tile_cells=16))
    assert report["triangles"] == 2 * 41 * 51
    return tmp_path / "asset"


def test_the_asset_folder_is_complete(folder):
    assert {path.name for path in folder.iterdir()} == {"mesh.m3a", "materials.json", "objects.jsonl", "report.json", "textures"}
    report = json.loads((folder / "report.json").read_text())
    assert (report["format"], report["objects"], skipped(report)) == ("terrain", 12, {})
    assert report["box_source"][0][:2] == [WEST, NORTH - 80]
    assert report["box_source"][1][:2] == [WEST + 100, NORTH]
    lines = [json.loads(line) for line in (folder / "objects.jsonl").read_text().splitlines()]
    assert [line["name"] for line in lines] == [f"terrain-{row}-{column}" for row in range(3) for column in range(4)]
    keys = {material["texture"] for material in json.loads((folder / "materials.json").read_text())["materials"]}
    assert keys == {path.stem for path in (folder / "textures").iterdir()}


def test_the_mesh_contains_every_triangle(folder):
    data = (folder / "mesh.m3a").read_bytes()
    assert data[:4] == b"M3DA"
    vertices, triangles = np.frombuffer(data, "<u8", 2, 16)
    assert triangles == 2 * 41 * 51
    positions = np.frombuffer(data, "<f8", int(vertices) * 3, 64).reshape(-1, 3)
    assert len(np.unique(positions, axis=0)) == 42 * 52
