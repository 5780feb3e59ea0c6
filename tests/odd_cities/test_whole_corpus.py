"""A folder with every oddity at once becomes a map and a report in one go; no file of it is passed over in silence."""

import json
import re
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from tests.cli.towns import Run
from tests.odd_cities.corpus import write_corpus
from tests.odd_cities.towns import world_boxes
from tests.publish.test_report_page import Elements

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole

SAID = (
    r"sparse\.gml\W*a sparse file of 53,687,091,200 bytes",
    r"gauss-krueger\.gml.*give --crs OGC:CRS84 to read them as degrees",
    r"no-label\.gml.*the file does not name its CRS; name it with --crs",
    r"town\.json.*CityJSON; convert it to CityGML",
    r"points\.las.*a LAS point cloud",
    r"axes swapped, so the file is read as longitude, latitude.*swapped.*near Munich, Germany",
    r"image: file not found.*lost\.png",
    r"document broken\W*cut.*; what comes before is kept",
    r"not UTF-8 as declared; other bytes read as Windows-1252.*latin-1",
    r"left out 13 triangles of 2 objects, far from the rest",
    r"town\.gml: 1 triangle, up to 5,335 km away: house-1-2 \(in part\)",
    r"other-zone\.gml: 12 triangles, up to 446 km away: zone-house-0-0",
)
"""What both the terminal and the report say."""

DRAWN = {"town.gml": 191, "swapped.gml": 108, "shop.obj": 12, "spiral.obj": 3998, "latin-1.gml": 2, "two-lods.gml": 2, "other-zone.gml": 12}
"""Triangles of files: a box has 12, a polygon two fewer than corners; a polygon of `town.gml` became one triangle."""


@pytest.fixture
def city(tmp_path: Path) -> Path:
    return write_corpus(tmp_path / "city")


def test_site_ends_with_a_map_and_a_report(tmp_path: Path, run: Run, city: Path) -> None:
    status, out, err = run("site", "city", "-o", "map", "--view", "45-45", "--res", "0.5", "--workers", "1", "--max-memory", "512M")
    assert status == 0, err
    assert "near Munich, Germany" in out
    for pattern in SAID:
        assert re.search(pattern, out + err), pattern

    page = Elements((tmp_path / "map" / "report.html").read_text())
    text = re.sub(r"\s+", " ", page.text)
    for pattern in SAID:
        assert re.search(pattern, text), pattern
    assert str(tmp_path) not in page.text
    for file in (file for file in city.rglob("*") if file.suffix in (".gml", ".obj", ".json", ".las")):
        assert file.name in text, f"nothing is said of {file.name}"
    assert "3 rasters of elevation and 4 rasters of imagery" in text
    assert (tmp_path / "map" / "index.html").is_file()
    manifest = json.loads((tmp_path / "map" / "rendering.json").read_text())
    assert manifest["views"][0]["archives"]
    assert run("verify", "--published", "map")[0] == 0


def test_what_is_kept_is_whole(tmp_path: Path, run: Run, city: Path) -> None:
    status, out, _ = run("inspect", "city", "--json")
    assert status == 1
    found = json.loads(out)
    assert {file["source"]: file["triangles"] for file in found["files"]} | DRAWN == {file["source"]: file["triangles"] for file in found["files"]}
    assert sorted(Path(file).name for file, _ in found["failed"]) == ["gauss-krueger.gml", "no-label.gml", "sparse.gml"]
    lods = {file["source"]: [kind["lod"] for kind in file["kinds"]] for file in found["files"]}
    assert lods["two-lods.gml"] == ["2"], "one level of detail is drawn, the finer"
    (cut,) = (file for file in found["files"] if file["source"] == "cut.gml")
    assert 120 <= cut["triangles"] < 192, "the polygons before the cut are kept"
    assert run("site", "city", "-o", "map", "--view", "0-90", "--res", "2", "--workers", "1")[0] == 0
    boxes = world_boxes(Workspace(tmp_path / "workspace"), "city")
    low, high = zip(*boxes.values(), strict=True)
    assert max(high)[0] - min(low)[0] < 2_000, "nothing far away makes the map large"
    assert {f"house-{i}-{j}" for i in range(4) for j in range(4)} <= boxes.keys()
