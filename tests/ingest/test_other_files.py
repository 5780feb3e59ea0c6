"""Each file of a folder ends in one of read, used by another, left out and why, or not readable and why."""

import zipfile
from collections import Counter
from pathlib import Path

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import import_files
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.sources import find_sources
from map3d.messages import Message
from tests.cli.bad_files import elevation, jpeg, textured
from tests.cli.towns import write_town

WITHOUT_CITY = ("LICENSE", "README", "notes.md", "plan.pdf", "list.json", "schema.xsd.txt")
UNUSED = ("lonely.mtl", "photo.jpg", "empty.prj", "schema.xsd")
UNREAD = ("list.csv", "noext", "meta.xml")
HIDDEN = (".DS_Store", "sub/.~lock.x")


def write_city(folder: Path) -> Path:
    """Writes documents, what they use, and files of all other kinds."""
    folder.mkdir()
    textured(folder, "a", 0, jpeg())
    write_town(folder / "x", 1)
    elevation(folder / "dem.tif")
    (folder / "dem.tfw").write_text("10\n0\n0\n-10\n-55\n135\n")
    (folder / "a.pdf").write_bytes(b"%PDF")
    (folder / "sub").mkdir()
    for name in (*WITHOUT_CITY, *UNUSED, *UNREAD, *HIDDEN):
        (folder / name).write_text("<metadata/>" if name.endswith(".xml") else "text")
    (folder / "photo.jpg").write_bytes(jpeg())
    (folder / "empty.gml").touch()
    for own, files in (("work", ("catalogue.sqlite", "scenes/town/mesh.m3a")), ("out", ("rendering.json", "checksums.sha256", "index.html"))):
        for name in files:
            (folder / own / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / own / name).write_text("text")
    return folder


def ends(folder: Path) -> dict[str, str]:
    """Returns file → the code of what becomes of it; raises AssertionError for a file that is named twice."""
    found: list[tuple[Path, str]] = []

    def note(path: Path, said: Message) -> None:
        found.append((path, said.code))

    sources = find_sources([folder], on_unreadable=note, on_note=note)
    found += [(path, "read") for source in sources for path in source.paths]
    assert [path for path, count in Counter(path for path, _ in found).items() if count > 1] == []
    return {path.relative_to(folder).as_posix(): code for path, code in found}


def test_every_file_has_one_end(tmp_path: Path) -> None:
    folder = write_city(tmp_path / "city")
    found = ends(folder)
    assert {name for name, code in found.items() if code == "read"} == {"a.obj", "x/house-0-0.obj", "dem.tif"}
    assert {name for name, code in found.items() if code.startswith("used-")} == {"a.mtl", "a.jpg", "a.pdf", "dem.tfw"}
    for names, code in ((WITHOUT_CITY, "without-city-data"), (UNUSED, "not-used"), (UNREAD, "format-ignored"), (HIDDEN, "left-hidden")):
        assert {name for name, said in found.items() if said == code} == set(names), code
    assert {name for name, code in found.items() if code == "left-own-folder"} == {"work", "out"}
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert {name for name in files if name.partition("/")[0] not in ("work", "out")} == found.keys() - {"work", "out"}


def test_a_folder_of_map3d_itself_is_searched_when_it_is_given(tmp_path: Path) -> None:
    folder = write_town(tmp_path / "work", 1)
    (folder / "workspace.json").write_text("{}")
    assert ends(folder) == {"house-0-0.obj": "read", "workspace.json": "without-city-data"}


def test_every_file_of_a_zip_archive_has_one_end(tmp_path: Path) -> None:
    textured(tmp_path, "a", 0, jpeg())
    archive = tmp_path / "city.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        for name in ("a.obj", "a.mtl", "a.jpg"):
            packed.write(tmp_path / name, name)
        packed.writestr("readme.txt", "text")
        packed.writestr("__MACOSX/._a.obj", "resources")
    workspace = Workspace(tmp_path / "ws").create()
    with workspace.open_catalogue() as catalogue:
        catalogue.create_scene(SceneRecord("town"))
        done = import_files(workspace, catalogue, "town", [archive], ImportOptions())
    codes = {Path(path).name: note.code for path, note in done.ignored}
    assert codes == {"a.mtl": "used-beside", "a.jpg": "used-beside", "readme.txt": "without-city-data", "._a.obj": "left-hidden"}
