"""Bad input on the command line: error messages, skipped parts, and the rendering of all usable parts."""

import json
import re
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.registry import Registry
from tests.cli.bad_files import BAD_LINES, DAMAGED_IMAGES, USELESS_FILES, citygml, elevation, house_with, jpeg, textured, truncated
from tests.cli.tile_ids import ids_in_tiles
from tests.cli.towns import Run, house
from tests.findings import skipped, warned

pytestmark = pytest.mark.whole


@pytest.fixture
def run(run: Run) -> Run:
    """Runs a command line and checks that it prints no traceback. Creates the scene `town`."""

    def call(*arguments: str) -> tuple[int, str, str]:
        status, out, err = run(*arguments)
        assert "Traceback" not in out + err
        return status, out, err

    call("create-scene", "town")
    return call


@pytest.mark.parametrize(
    ("name", "data", "status", "says"),
    [
        ("model.skp", b"\xff\xfe\xff\x0eSketchUp", 2, ("model.skp: a file of unknown format", "CityGML", "OBJ")),
        ("a.zip", b"PK\x03\x04", 1, ("a.zip: cannot be unpacked: File is not a zip file",)),
        ("a.gml", b"<html></html>", 2, ("a.gml: XML with root element html", "CityGML")),
        ("empty.gml", b"", 2, ("empty.gml: an empty file", "CityGML")),
        ("empty.obj", b"", 2, ("empty.obj: an empty file", "OBJ")),
        (
            "nothing.obj",
            USELESS_FILES["nothing.obj"],
            1,
            ("nothing.obj: no usable triangle in the file", "refer to missing vertices: 1."),
        ),
        ("cut.tif", USELESS_FILES["cut.tif"], 1, ("cut.tif: not a valid GTiff raster",)),
        ("bomb.gml", USELESS_FILES["bomb.gml"], 1, ("bomb.gml: a document type definition is not allowed", "remove it")),
        ("head.gml", citygml().encode()[:300], 1, ("head.gml: no usable triangle in the file",)),
    ],
)
def test_useless_file_is_refused_in_one_line(run: Run, tmp_path: Path, name: str, data: bytes, status: int, says: tuple[str, ...]) -> None:
    (tmp_path / name).write_bytes(data)
    got, out, err = run("add-files", "town", name)
    assert (got, out) == (status, "")
    assert err.startswith("map3d: ")
    assert err.count("\n") == 1
    assert err.count(str(tmp_path / name)) <= 1, "the message contains the path once"
    assert "Error" not in err
    assert "Failed:" not in err
    assert [part for part in says if part not in err] == []
    assert json.loads(run("show", "scene", "town", "--json")[1])["assets"] == []


@pytest.mark.parametrize("names", [(), ("notes.txt",), ("empty.gml",)])
def test_folder_without_usable_files_is_refused(run: Run, tmp_path: Path, names: tuple[str, ...]) -> None:
    (tmp_path / "folder").mkdir()
    for name in names:
        (tmp_path / "folder" / name).touch()
    status, _, err = run("add-files", "town", "folder")
    assert (status, err.count("\n")) == (2, 1)
    assert "folder: no readable file in this folder" in err
    assert ("empty.gml: an empty file" in err) == ("empty.gml" in names)


@pytest.mark.parametrize("name", sorted(BAD_LINES))
def test_invalid_lines_skip_only_their_faces(run: Run, tmp_path: Path, name: str) -> None:
    house_with(BAD_LINES[name])(tmp_path / "a.obj")
    bad = sum(line.startswith("f") for line in BAD_LINES[name].splitlines())
    status, out, err = run("add-files", "town", "a.obj", "--json")
    assert (status, err) == (0, "")
    (report,) = (item["report"] for item in json.loads(out)["imported"])
    assert (report["triangles"], sum(skipped(report).values())) == (12, bad)
    status, out, _ = run("add-files", "town", "a.obj")
    assert (status, f": {bad}. Example: " in out, "line " in out) == (0, True, True)
    status, _, err = run("add-files", "town", "a.obj", "--strict")
    assert (status, err.count("\n"), "line " in err) == (1, 1, True)


def test_truncated_document_is_read_up_to_the_cut(run: Run, tmp_path: Path) -> None:
    (tmp_path / "a.gml").write_text(truncated())
    status, out, err = run("add-files", "town", "a.gml", "--crs", "local")
    assert (status, err) == (0, "")
    assert re.search(r"a: The file breaks off; what comes before is kept\. Example: at byte \d+, line \d+ \(.*\)\n", out)
    with Registry(Workspace(tmp_path / "workspace").registry_path("town")) as registry:
        assert {"one", "two"} <= {item.name for item in registry.objects()}


@pytest.fixture
def messy(tmp_path: Path) -> Path:
    """A folder in which nearly every file has a defect."""
    folder = tmp_path / "messy"
    folder.mkdir()
    (folder / "good.obj").write_text(house(0, 30, 8))
    for k, (name, lines) in enumerate(BAD_LINES.items()):
        house_with(lines, x=20.0 * k)(folder / f"{name}.obj")
    for k, (name, image) in enumerate({**DAMAGED_IMAGES, "sound": jpeg()}.items()):
        textured(folder, name, 20.0 * (k + len(BAD_LINES)), image)
    for name, data in USELESS_FILES.items():
        (folder / name).write_bytes(data)
    (folder / "truncated.gml").write_text(truncated())
    elevation(folder / "plain.tif")
    return folder


def test_all_usable_parts_of_a_messy_folder_are_rendered(run: Run, tmp_path: Path, messy: Path) -> None:
    status, out, err = run("add-files", "town", str(messy), "--crs", "local", "--json")
    assert (status, err) == (1, "")
    answer = json.loads(out)
    assert sorted(Path(item["source"]).name for item in answer["failed"]) == sorted({*USELESS_FILES} - {"cut.tif"})
    assert all(Path(item["source"]).name in item["error"] for item in answer["failed"])
    reports = {item["asset"]: item["report"] for item in answer["imported"]}
    assert set(reports) == {"good", "messy", "truncated", "sound", *BAD_LINES, *DAMAGED_IMAGES}
    said = {name: " ".join(f"{w['code']} {w['example']}" for w in warned(report)) for name, report in reports.items()}
    assert "cut.tif" in said["messy"], "the elevation model is imported without the damaged raster"
    assert "image-file-not-found missing.jpg" in said["missing"]
    assert "image-format-unknown zero.jpg" in said["zero"]
    assert "image-format-unknown text.jpg" in said["text"]
    assert "image-damaged" in said["cut"], "the import detects the cut image"
    assert said["good"] == said["sound"] == said["lying"] == ""

    status, out, err = run("create-rendering", "town", "view", "--res", "0.2", "--view", "0/45", "--json")
    assert status == 0, err
    built = json.loads(out)["build"]
    assert built["materials_without_their_texture"] == 0, "the model does without the damaged image"
    status, out, err = run("render", "view", "--json")
    assert (status, json.loads(out)["complete"]) == (0, True), err
    workspace = Workspace(tmp_path / "workspace")
    with Registry(workspace.registry_path("town")) as registry:
        names = {item.id: item.name for item in registry.objects()}
    seen = {names[number] for number in ids_in_tiles(workspace) if number}
    assert {"good", "sound", "one", "two", *BAD_LINES, *DAMAGED_IMAGES} <= seen
    assert run("verify")[0] == 0


def test_strict_imports_nothing_from_a_folder_with_an_unreadable_file(run: Run, messy: Path) -> None:
    status, out, err = run("add-files", "town", str(messy), "--strict")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "empty.gml: an empty file" in err
    assert json.loads(run("show", "scene", "town", "--json")[1])["assets"] == []
