"""docs/formats.md: what is in the files is counted in their text; with the data sets, its rows are those of today."""

import importlib.util
import os
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tests.cli.towns import house
from tests.ingest.terrain.rasters import write
from tests.odd_cities.towns import MUNICH, at, write_citygml

DOCS = Path(__file__).parents[2] / "docs"
DATA = os.environ.get("MAP3D_DATA")
SMALL = {
    "citygml-munich-lod2-solid": "111 Building, 1,056 polygons",
    "citygml-potsdam-lod1": "97 Building, 1,547 polygons",
    "obj-3dfier-delft": "28,619 faces",
}
"""Data sets that are read in a second, with the counts of their NOTICE files."""


@pytest.fixture(scope="module")
def make_formats() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_formats", DOCS / "make_formats.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_elements_faces_and_pixels_are_counted_in_the_files(tmp_path: Path, make_formats: ModuleType) -> None:
    town = write_citygml(tmp_path / "town.gml", "EPSG:25832", at(*MUNICH, "EPSG:25832"))
    town.write_text(town.read_text().replace("</core:CityModel>", "<!-- <bldg:Building><gml:Polygon> --></core:CityModel>"))
    (tmp_path / "list.xml").write_text("<Dictionary/>")
    (tmp_path / "a.obj").write_text(house(0, 0, 5) + "fly 1 2 3\n")
    (tmp_path / "b.obj").write_bytes(b"\xff\xfe" + house(0, 0, 5).encode("utf-16-le"))
    write(tmp_path / "c.tif", np.zeros((1, 4, 6), np.float32))
    text = make_formats.count_source(tmp_path).text()
    assert text == "1 CityGML file: 16 Building, 96 polygons; 2 OBJ files: 12 faces; 1 raster: 24 pixels; others: 1 .xml without a CityModel"


def test_a_row_says_what_is_drawn_and_what_is_not(tmp_path: Path, make_formats: ModuleType) -> None:
    folder = tmp_path / "town"
    write_citygml(folder / "town.gml", "EPSG:25832", at(*MUNICH, "EPSG:25832"))
    write_citygml(folder / "other.gml", None, at(*MUNICH, "EPSG:25832"), prefix="other-")
    (folder / "bad.obj").write_text(house(0, 0, 5) + "f 1 1 1\n")
    cells = [cell.strip() for cell in make_formats.row(folder).split(" | ")]
    assert cells[:5] == ["| town", "2 CityGML files: 32 Building, 192 polygons; 1 OBJ file: 7 faces", "17", "204", "–"]
    assert cells[5].startswith("Skipped faces with fewer than 3 vertices: 1; 1 file: the file does not name its CRS; name it with --crs")


@pytest.mark.skipif(not DATA, reason="MAP3D_DATA does not name the folder of real data sets")
@pytest.mark.parametrize("name", SMALL)
def test_the_table_is_up_to_date(name: str, make_formats: ModuleType) -> None:
    row = make_formats.row(Path(DATA or "") / name)
    assert SMALL[name] in row
    assert row in (DOCS / "formats.md").read_text(encoding="utf-8"), "run python docs/make_formats.py DATA"
