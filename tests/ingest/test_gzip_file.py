"""Gzip files are read like their content, within limits, and the files that they name are found."""

import gzip
import os
import random
import re
from pathlib import Path

import pytest

from map3d.errors import LimitExceeded, UnknownFormat
from map3d.formats import CITYGML, gzip_file
from map3d.formats.detect import detect_format
from map3d.formats.gzip_file import content_bytes, content_windows, is_gzip, unpacked_head, unpacked_path
from map3d.ingest.import_options import GIB, ImportOptions
from map3d.ingest.sources import find_sources, source_digest
from tests.cli.conftest import run
from tests.cli.towns import Run, house
from tests.odd_cities.towns import MUNICH, at, write_citygml

__all__ = ["run"]


def pack(path: Path) -> Path:
    """Replaces a file by its packed twin."""
    packed = path.with_name(f"{path.name}.gz")
    packed.write_bytes(gzip.compress(path.read_bytes(), mtime=0))
    path.unlink()
    return packed


def test_the_content_decides(tmp_path: Path) -> None:
    for name, content, found in (
        ("a.gml.gz", b'<CityModel xmlns="x">', "citygml"),
        ("b.obj.gz", b"v 0 0 0\n", "obj"),
        ("c.bin", b"v 0 0 0\n", "obj"),
    ):
        (tmp_path / name).write_bytes(gzip.compress(content))
        assert detect_format(tmp_path / name).name == found
    for content, described in ((b"II*\0", "a gzip file of a raster; unpack it first"), (b"\0", "a gzip file of a file of unknown format")):
        (tmp_path / "d.gz").write_bytes(gzip.compress(content))
        with pytest.raises(UnknownFormat, match=described):
            detect_format(tmp_path / "d.gz")


def test_windows_hold_every_line_whole(tmp_path: Path) -> None:
    lines = [random.Random(k).randbytes(40 + k % 90).hex().encode() + b"\n" for k in range(30_000)]
    (tmp_path / "a.gz").write_bytes(gzip.compress(b"".join(lines), 1))
    windows = list(content_windows(tmp_path / "a.gz", 8192))
    assert len(windows) > 3
    assert set(lines) <= {line for window in windows for line in window.splitlines(keepends=True)}
    assert sum(map(len, windows)) < 1.1 * content_bytes(tmp_path / "a.gz") + 9000
    assert content_bytes(tmp_path / "a.gz") == sum(map(len, lines))


def test_names_across_the_ends_of_windows_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gzip_file, "_PART_BYTES", 1 << 14)
    names = [f"textures/{'x' * (k % 50)}{k}.png" for k in range(3_000)]
    text = '<CityModel xmlns="x">' + "".join(f"<app:imageURI>{name}</app:imageURI>" for name in names) + "</CityModel>"
    path = tmp_path / "town.gml"
    path.write_text(text)
    (tmp_path / "textures").mkdir()
    (tmp_path / names[7]).write_bytes(b"")
    plain = CITYGML.find_missing(path, None)
    packed = pack(path)
    assert CITYGML.find_missing(packed, None) == plain
    assert (plain.images, plain.missing_images) == (3_000, 2_999)
    assert CITYGML.find_files(packed, None) == {(tmp_path / names[7]).resolve()}


def test_the_limits_follow_the_content(tmp_path: Path) -> None:
    path = tmp_path / "a.gml.gz"
    with gzip.open(path, "wb", compresslevel=1) as file:
        for _ in range(130):
            file.write(os.urandom(10_000).hex().encode() * 50)
    assert path.stat().st_size < 60_000_000 < 120_000_000 < content_bytes(path)
    limits = ImportOptions().limits([path], "citygml")
    assert (limits.address_space_bytes, limits.cpu_s) == (2 * GIB, 120)


def test_a_bomb_is_refused_before_it_is_read(tmp_path: Path, run: Run) -> None:
    with gzip.open(tmp_path / "bomb.gml.gz", "wb") as file:
        file.write(b'<CityModel xmlns="x">')
        for _ in range(300):
            file.write(bytes(1 << 20))
    assert unpacked_head(tmp_path / "bomb.gml.gz", 4) == b"<Cit"
    with pytest.raises(LimitExceeded, match=r"bomb\.gml\.gz: grows to more than 200 times its packed size"):
        ImportOptions().limits([tmp_path / "bomb.gml.gz"], "citygml")
    assert run("create-scene", "town")[0] == 0
    status, _, err = run("add-files", "town", "bomb.gml.gz")
    assert status != 0
    assert "bomb.gml.gz: grows to more than 200 times its packed size; unpack it first\n" in err


def test_a_packed_city_is_imported_like_its_content(tmp_path: Path, run: Run) -> None:
    plain = write_citygml(tmp_path / "plain" / "town.gml", "EPSG:25832", at(*MUNICH, "EPSG:25832"))
    packed = pack(write_citygml(tmp_path / "packed" / "town.gml", "EPSG:25832", at(*MUNICH, "EPSG:25832")))
    assert (is_gzip(packed), unpacked_path(packed).name) == (True, "town.gml")
    (source,) = find_sources([packed.parent])
    assert (source.name, source.format) == ("town", "citygml")
    assert source_digest(source) != source_digest(find_sources([plain])[0])
    for scene, folder in (("a", "plain"), ("b", "packed")):
        assert run("create-scene", scene)[0] == 0
        status, out, err = run("add-files", scene, folder)
        assert status == 0, err
        assert re.search(r"^town +citygml +16 +192 ", out, re.MULTILINE)
    status, out, _ = run("inspect", "packed", "--json")
    assert status == 0
    assert '"triangles": 192' in out


def test_a_cut_city_keeps_what_was_read(tmp_path: Path, run: Run) -> None:
    packed = pack(write_citygml(tmp_path / "city" / "town.gml", "EPSG:25832", at(*MUNICH, "EPSG:25832")))
    data = packed.read_bytes()
    packed.write_bytes(data[: len(data) * 2 // 3])
    status, out, err = run("site", "city", "-o", "site", "--res", "1", "--view", "0-90", "--workers", "1")
    assert status == 0, err
    assert "The packed file is cut off or damaged; what could be unpacked is kept. Example: town: after " in out
    assert "The file breaks off; what comes before is kept. Example: town: at byte " in out
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / "house.obj").write_text(house(0, 0, 6) + "".join(f"v {k * 0.37:.3f} {k * k % 977} 0\n" for k in range(3000)))
    model = pack(tmp_path / "bad" / "house.obj")
    model.write_bytes(model.read_bytes()[:-900])
    assert run("create-scene", "bad")[0] == 0
    status, _, err = run("add-files", "bad", "bad/house.obj.gz", "--crs", "local")
    assert status != 0
    assert "house.obj.gz" in err
    assert "gzip file cut or damaged after " in err
