"""`map3d inspect` says what files hold, and leaves nothing behind."""

import json
import shutil
import tempfile
from pathlib import Path

import pytest

from tests.cli.towns import Run, house
from tests.ingest.terrain.rasters import colours, hills, write
from tests.odd_cities.towns import MUNICH, at, write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

UTM_32 = "urn:ogc:def:crs:EPSG::25832"


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def test_a_citygml_file(tmp_path: Path, run: Run, temporary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    town = write_citygml(tmp_path / "town.gml", UTM_32, at(*MUNICH, "EPSG:25832"))
    monkeypatch.setenv("MAP3D_CATALOGUE", f"sqlite://{tmp_path}/real.sqlite")
    status, out, err = run("inspect", str(town))
    assert (status, err) == (0, "")
    rows = {line[:12].strip(): line[13:] for line in out.splitlines()}
    assert rows["file"].startswith("town.gml, citygml, ")
    assert rows["coordinates"] == "ETRS89 / UTM zone 32N"
    assert rows["place"].startswith("near Munich, Germany (48.137° N, 11.57")
    assert rows["objects"] == "16: 16 building (LoD 1)"
    assert rows["triangles"] == "192"
    assert rows["extent"].endswith("heights 500.0 to 512.0 m")
    assert rows["textures"] == "none"
    assert not list(temporary.iterdir())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["temporary", "town.gml"]


def test_a_folder_of_all_formats(tmp_path: Path, run: Run, temporary: Path) -> None:
    folder = tmp_path / "city"
    write_citygml(folder / "town.gml", UTM_32, at(*MUNICH, "EPSG:25832"))
    write_citygml(folder / "far.gml", UTM_32, at(11.5755, 50.1374, "EPSG:25832"), side=2, prefix="far-")
    (folder / "dem").mkdir()
    write(folder / "dem" / "height.tif", hills(20, 20))
    write(folder / "dem" / "photo.tif", colours(20, 20))
    (folder / "cut.gml").write_text((folder / "town.gml").read_text()[:300])
    (folder / "town.json").write_text('{"type": "CityJSON"}')
    status, out, err = run("inspect", str(folder), "--json")
    assert status == 1
    found = json.loads(out)
    files = {file["source"]: file for file in found["files"]}
    assert files["town.gml"]["kinds"] == [{"kind": "building", "lod": "1", "count": 16, "drawn": 16}]
    assert files["far.gml"]["triangles"] == 48
    assert files["height.tif"]["rasters"] == {"elevation": 1, "imagery": 1}
    assert files["height.tif"]["crs"] == "ETRS89 / UTM zone 32N"
    assert found["crs"]["epsg"] == 25832
    assert [cluster["objects"] for cluster in found["clusters"]] == [17, 4]
    assert [Path(file).name for file, _ in found["failed"]] == ["cut.gml"]
    assert [reason["text"] for _, reason in found["ignored"]] == ["CityJSON; convert it to CityGML with citygml-tools"]
    status, out, err = run("inspect", str(folder))
    assert status == 1
    assert "20 building (LoD 1)" in out
    assert "the files lie in places far from each other" in out
    assert "CityJSON; convert it" in out
    assert "not readable: " in err
    assert "cut.gml" in err
    assert not list(temporary.iterdir())


def test_textures_and_defects_of_an_obj_file(tmp_path: Path, run: Run) -> None:
    town = tmp_path / "town.obj"
    lines = house(0, 0, 9).splitlines()
    town.write_text("\n".join(["mtllib town.mtl", *lines[:8], "vt 0 0", "vt 1 0", "vt 1 1", "usemtl wall", *lines[8:], "f 1 1 1"]) + "\n")
    (tmp_path / "town.mtl").write_text("newmtl wall\nmap_Kd wall.jpg\n")
    status, out, _ = run("inspect", str(town), "--crs", "local")
    assert status == 0
    assert "textures     1, 1 missing: wall.jpg" in out
    assert "Skipped faces with fewer than 3 vertices: 1. Example: " in out


def test_a_single_unreadable_file_is_an_error(tmp_path: Path, run: Run, temporary: Path) -> None:
    (tmp_path / "notes.gml").write_text("no city")
    status, out, err = run("inspect", str(tmp_path / "notes.gml"))
    assert (status, out) == (2, "")
    assert "notes.gml: a file of unknown format; map3d reads CityGML" in err
    assert not list(temporary.iterdir())


def test_a_zip_archive_is_inspected_as_its_folder(tmp_path: Path, run: Run, temporary: Path) -> None:
    town = write_citygml(tmp_path / "city" / "town.gml", UTM_32, at(*MUNICH, "EPSG:25832"))
    size = town.stat().st_size
    shutil.make_archive(str(tmp_path / "city"), "zip", tmp_path / "city")
    shutil.rmtree(tmp_path / "city")
    status, out, err = run("inspect", "city.zip", "--json")
    assert (status, err) == (0, "")
    (file,) = json.loads(out)["files"]
    assert (file["source"], file["bytes"], file["triangles"]) == ("town.gml", size, 192)
    assert not list(temporary.iterdir())
