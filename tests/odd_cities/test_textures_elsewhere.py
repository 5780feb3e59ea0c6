"""Textures beside the folder of the document, inside the folder that was given; missing textures; ignored files."""

import os
from pathlib import Path

import pytest
from PIL import Image

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import import_files
from map3d.formats import OBJ as OBJ_FORMAT
from map3d.ingest.import_options import ImportOptions
from tests.cli.towns import Run, house
from tests.odd_cities.towns import write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

OBJ = "mtllib town.mtl\nusemtl wall\nvt 0 0\nvt 1 0\nvt 1 1\nv 0 0 0\nv 8 0 0\nv 8 0 6\nf 1/1 2/2 3/3\n"


def write_town(folder: Path) -> Path:
    """Writes models/town.obj, whose material library and image are in folders beside."""
    for name in ("models", "textures"):
        (folder / name).mkdir(parents=True)
    (folder / "models" / "town.mtl").write_text("newmtl wall\nmap_Kd ../textures/wall.png\n")
    (folder / "models" / "town.obj").write_text(OBJ)
    Image.new("RGB", (8, 8), (200, 30, 30)).save(folder / "textures" / "wall.png")
    return folder


def textures_of(tmp_path: Path, path: Path, scene: str) -> tuple[int, dict[str, int]]:
    """Imports a path; returns the number of textures in the asset, and the counts of the report."""
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord(scene))
    (done,) = import_files(workspace, catalogue, scene, [path], ImportOptions()).imported
    catalogue.close()
    return len(list((workspace.asset_folder(scene, "town") / "textures").iterdir())), done.report["textures"]


def test_textures_inside_the_given_folder_are_read(tmp_path: Path) -> None:
    city = write_town(tmp_path / "city")
    assert textures_of(tmp_path, city, "folder") == (1, {"images": 1, "missing": 0})
    assert textures_of(tmp_path, city / "models", "models") == (0, {"images": 1, "missing": 1})
    assert textures_of(tmp_path, city / "models" / "town.obj", "file") == (0, {"images": 1, "missing": 1})


@pytest.mark.parametrize("outside", ["../../secret.png", "link.png", "linked/secret.png"])
def test_nothing_outside_the_given_folder_is_read(tmp_path: Path, outside: str) -> None:
    city = write_town(tmp_path / "city")
    Image.new("RGB", (8, 8)).save(tmp_path / "secret.png")
    os.symlink(tmp_path / "secret.png", city / "models" / "link.png")
    os.symlink(tmp_path, city / "models" / "linked")
    (city / "models" / "town.mtl").write_text(f"newmtl wall\nmap_Kd {outside}\n")
    assert textures_of(tmp_path, city, "town") == (0, {"images": 1, "missing": 1})
    assert OBJ_FORMAT.find_files(city / "models" / "town.obj", city) == {(city / "models" / "town.mtl").resolve()}
    assert OBJ_FORMAT.find_missing(city / "models" / "town.obj", city).names == [outside]


def test_site_counts_missing_textures_and_says_which_files_it_ignored(tmp_path: Path, run: Run) -> None:
    city = write_town(tmp_path / "city")
    (city / "models" / "town.mtl").write_text("newmtl wall\nmap_Kd ../textures/wall.png\nmap_bump ../textures/none.png\n")
    (city / "other").mkdir()
    (city / "other" / "a.json").write_text('{"type": "CityJSON", "version": "2.0"}')
    (city / "other" / "settings.json").write_text("{}")
    (city / "LICENSE").write_text("CC BY 4.0")
    (city / "notes").write_text("Seen in May.")
    (city / "other" / "points.las").write_bytes(b"LASF" + bytes(100))
    Image.new("RGB", (8, 8)).save(city / "other" / "photo.jpg")
    (city / "other" / "photo.jgw").write_text("1\n0\n0\n-1\n0\n0\n")
    status, out, err = run("site", "city", "-o", "site", "--res", "1", "--view", "0-45", "--workers", "1")
    assert status == 0, err
    assert "1 of 2 textures missing, e.g. town: ../textures/none.png; they must be in the given folder or below\n" in out
    assert "ignored (unsupported format): other/a.json (CityJSON; convert it to CityGML with citygml-tools)\n" in out
    assert "ignored (unsupported format): other/points.las (a LAS point cloud)\n" in out
    assert "imported 2 files" in out
    assert "other/settings.json (a document or list without city data)" in out
    assert "ignored (unsupported format): notes (a file of unknown format)\n" in out


def test_site_has_the_options_of_an_import(tmp_path: Path, run: Run) -> None:
    (tmp_path / "city").mkdir()
    (tmp_path / "city" / "a.obj").write_text("g one\n" + house(0, 0, 6).replace("f 5", "g two\nf 5", 1))
    write_citygml(tmp_path / "city" / "b.gml", None, lambda corners: corners)
    options = ("--crs", "local", "--split", "group", "--lod", "1", "--theme", "photos", "--up", "z")
    status, _, err = run("site", "city", "-o", "site", "--res", "1", "--view", "0-90", "--workers", "1", *options)
    assert status == 0, err
    catalogue = Workspace(tmp_path / "workspace").open_catalogue()
    inputs = {asset.name: asset.report["inputs"]["options"] for asset in catalogue.assets("city")}
    catalogue.close()
    assert (inputs["a"]["split"], inputs["b"]["lod"], inputs["b"]["theme"]) == ("group", "1", "photos")


def test_a_model_on_its_side_gets_a_hint(tmp_path: Path, run: Run) -> None:
    houses = [house(40.0 * k, 40.0 * j, 10.0).splitlines() for k in range(5) for j in range(5)]
    lines, count = [], 0
    for one in houses:
        for line in one:
            kind, *words = line.split()
            if kind == "v":
                x, y, z = words
                lines.append(f"v {x} {z} -{y}")
            else:
                lines.append("f " + " ".join(str(int(word) + count) for word in words))
        count += 8
    (tmp_path / "side.obj").write_text("\n".join(lines) + "\n")
    assert run("create-scene", "town")[0] == 0
    status, out, _ = run("add-files", "town", "side.obj")
    assert status == 0
    assert "The model seems to lie on its side." in out
    assert "side.obj is 168 m wide, 10 m deep and 170 m high" in out
    status, out, _ = run("add-files", "town", "side.obj", "--up", "y")
    assert (status, "on its side" in out) == (0, False)
    (tmp_path / "tower.obj").write_text(house(0, 0, 300.0))
    assert "on its side" not in run("add-files", "town", "tower.obj")[1]
