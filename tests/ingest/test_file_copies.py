"""Backups, copies, links and packed twins: one file of each content is read, and what is left out is named."""

import gzip
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from map3d.ingest.file_copies import backed_up, is_copy_name
from map3d.ingest.sources import find_sources
from tests.cli.towns import house
from tests.ingest.terrain.rasters import colours, write
from tests.odd_cities.towns import MUNICH, at, write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

BACKUPS = ["town.gml~", "town.gml.~3~", "town.gml.bak", "town.gml.BAK2", "town.gml.orig", "town.gml.old", "#town.gml#"]
COPIES = [
    "town (1).gml", "town(2).gml", "town - Copy.gml", "town - Copy (2).gml", "Copy of town.gml", "Copy (2) of town.gml", "town copy.gml",
    "town copy 2.gml", "town (copy).gml", "town (3rd copy).gml", "town - Kopie.gml", "town - Kopie (2).gml", "Kopie von town.gml",
    "town (weitere Kopie).gml", "town - Copie.gml", "Copie de town.gml", "town_backup.gml", "town_old.gml", "town-bak.gml", "town (1).gml.gz",
]  # fmt: skip


def found(folder: Path, known: dict[str, Path] | None = None) -> tuple[list[str], dict[str, tuple[str, str]]]:
    """Returns the names of the files that are read, and of the others the code and the file that each is about; not of those that only accompany
    others."""
    notes: dict[str, tuple[str, str]] = {}

    def note(path: Path, said: object) -> None:
        notes[path.name] = (said.code, said.values.get("of", ""))  # type: ignore[attr-defined]

    sources = find_sources([folder], on_note=note, on_unreadable=note, known=known)
    read = sorted(path.name for source in sources for path in source.paths)
    return read, {name: said for name, said in notes.items() if said[0] != "used-beside"}


def town(folder: Path, name: str = "town.gml", lon: float = MUNICH[0]) -> Path:
    return write_citygml(folder / name, "EPSG:25832", at(lon, MUNICH[1], "EPSG:25832"), side=1)


@pytest.mark.parametrize("name", BACKUPS)
def test_a_backup_is_left_out_whatever_it_holds(tmp_path: Path, name: str) -> None:
    town(tmp_path)
    town(tmp_path, name, MUNICH[0] + 0.001)
    assert backed_up(name) == "town.gml"
    assert found(tmp_path) == (["town.gml"], {name: ("left-backup", "town.gml")})


def test_a_backup_is_read_where_its_original_is_not_there_or_cannot_be_read(tmp_path: Path) -> None:
    town(tmp_path, "town.gml~")
    assert found(tmp_path)[0] == ["town.gml~"]
    (tmp_path / "town.gml").write_bytes(b"")
    assert found(tmp_path) == (["town.gml~"], {"town.gml": ("format-not-read", "")})
    (tmp_path / "town.gml").write_text("<html>404</html>")
    assert found(tmp_path)[0] == ["town.gml~"]


def test_a_given_backup_is_read(tmp_path: Path) -> None:
    town(tmp_path)
    (source,) = find_sources([town(tmp_path, "town.gml~")])
    assert source.paths == (tmp_path / "town.gml~",)


@pytest.mark.parametrize("name", [*COPIES, "other.gml", "archive/town.gml", "a.gml"])
def test_equal_content_is_read_once_under_the_name_that_is_no_copys(tmp_path: Path, name: str) -> None:
    original = town(tmp_path)
    (tmp_path / name).parent.mkdir(exist_ok=True)
    content = original.read_bytes()
    (tmp_path / name).write_bytes(gzip.compress(content) if name.endswith(".gz") else content)
    if name.endswith(".gz"):
        (tmp_path / name).rename(tmp_path / "town.gml.gz")
        name = "town.gml.gz"
    kept = min(name, "town.gml") if not is_copy_name(name) and "/" not in name and ".gz" not in name else "town.gml"
    (left,) = {name, "town.gml"} - {kept}
    assert found(tmp_path) == ([Path(kept).name], {Path(left).name: ("left-same-content", kept)})


def test_names_of_copies_are_known_and_others_are_not() -> None:
    assert all(map(is_copy_name, COPIES))
    for name in ("town.gml", "town-2.gml", "LoD2_690_5336.gml", "Copenhagen.gml", "golden.gml", "kopiervorlage.gml", "town (north).gml"):
        assert not is_copy_name(name), name
        assert backed_up(name) is None, name


@pytest.mark.parametrize("name", ["town (1).gml", "other.gml"])
def test_other_content_of_the_same_size_is_read_too(tmp_path: Path, name: str) -> None:
    content = town(tmp_path).read_bytes()
    middle = len(content) // 2
    (tmp_path / name).write_bytes(content[:middle] + b" " + content[middle + 1 :])
    assert found(tmp_path) == (sorted(["town.gml", name]), {})


@pytest.mark.parametrize("make", [os.symlink, os.link])
@pytest.mark.parametrize("name", ["a-link.gml", "current/town.gml"])
def test_a_link_to_a_file_that_is_there_is_left_out(tmp_path: Path, make: object, name: str) -> None:
    original = town(tmp_path, "b/town.gml")
    (tmp_path / name).parent.mkdir(exist_ok=True)
    make(original, tmp_path / name)  # type: ignore[operator]
    names, notes = found(tmp_path)
    assert len(names) == 1
    assert [code for code, _ in notes.values()] == ["left-link"]
    if make is os.symlink:
        assert found(tmp_path)[1] == {Path(name).name: ("left-link", "b/town.gml")}


def test_a_link_out_of_the_folder_is_read(tmp_path: Path) -> None:
    (tmp_path / "city").mkdir()
    os.symlink(town(tmp_path, "outside.gml"), tmp_path / "city" / "town.gml")
    assert found(tmp_path / "city") == (["town.gml"], {})


def test_the_file_of_an_asset_stays_the_one_that_is_read(tmp_path: Path) -> None:
    content = town(tmp_path, "b.gml").read_bytes()
    (tmp_path / "a.gml").write_bytes(content)
    assert found(tmp_path)[0] == ["a.gml"]
    assert found(tmp_path, {"b": tmp_path / "b.gml"})[0] == ["b.gml"]


def test_the_copy_with_its_textures_is_read(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "h.obj").write_text("mtllib h.mtl\n" + house(0, 0, 6))
    (tmp_path / "b" / "h.mtl").write_text("newmtl x\n")
    assert found(tmp_path)[1] == {"h.obj": ("left-same-content", "b/h.obj")}


def test_equal_images_with_other_world_files_are_no_copies(tmp_path: Path) -> None:
    for number in range(3):
        Image.fromarray(np.full((8, 8, 3), 255, np.uint8)).save(tmp_path / f"{number}.jpg", quality=90)
        (tmp_path / f"{number}.jgw").write_text(f"1\n0\n0\n-1\n{691_000 + 8 * (number % 2)}\n5336000\n")
    assert found(tmp_path) == (["0.jpg", "1.jpg"], {"2.jpg": ("left-same-content", "0.jpg")})


def test_equal_rasters_are_read_once(tmp_path: Path) -> None:
    write(tmp_path / "dop.tif", colours(8, 8))
    (tmp_path / "dop - Kopie.tif").write_bytes((tmp_path / "dop.tif").read_bytes())
    assert found(tmp_path) == (["dop.tif"], {"dop - Kopie.tif": ("left-same-content", "dop.tif")})
