"""Uploaded archives: regular files inside the folder, limits one below, at and one above."""

import stat
import zipfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from map3d.errors import ImportFailed, LimitExceeded
from map3d.formats.archive_limits import ArchiveLimits
from map3d.ingest.zip_archive import is_zip, unpack, unpack_here
from tests.operations.archives import raw_entry, write_entry, write_zip

LIMITS = ArchiveLimits()


def unpacked(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_files_and_folders_are_unpacked(tmp_path: Path) -> None:
    files = {"a.obj": b"v 0 0 0\n", "textures/wall.png": b"\x89PNG", "textures/deep/er/ü.jpg": b"jpeg", "windows\\path.mtl": b"newmtl"}
    archive = write_zip(tmp_path / "town.zip", {**files, "empty/": b""})
    steps: list[tuple[int, int]] = []
    assert unpack(archive, tmp_path / "out", LIMITS, lambda *step: steps.append(step)) == 4
    assert unpacked(tmp_path / "out") == {name.replace("\\", "/"): data for name, data in files.items()}
    assert steps[-1] == (4, 4)
    assert is_zip(archive)
    assert not is_zip(tmp_path / "out" / "a.obj")


def test_archive_in_an_archive_stays_packed(tmp_path: Path) -> None:
    inner = write_zip(tmp_path / "inner.zip", {"a": b"a"})
    outer = write_zip(tmp_path / "outer.zip", {"inner.zip": inner.read_bytes()})
    unpack_here(outer, tmp_path / "out", LIMITS)
    assert unpacked(tmp_path / "out") == {"inner.zip": inner.read_bytes()}


@pytest.mark.parametrize("name", ["../a", "a/../../b", "/etc/passwd", "\\\\server\\share", "..\\a", "C:\\a", "C:a", "a\nb", ".."])
def test_name_that_leads_out_of_the_folder_is_refused(tmp_path: Path, name: str) -> None:
    archive = write_zip(tmp_path / "bad.zip", {"good.txt": b"good", name: b"bad"})
    before = sorted(path for path in tmp_path.rglob("*"))
    with pytest.raises(ImportFailed, match="outside the folder"):
        unpack_here(archive, tmp_path / "in" / "out", LIMITS)
    assert sorted(path for path in tmp_path.rglob("*") if "in" not in path.parts[-2:]) == before


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR, stat.S_IFSOCK])
def test_only_regular_files_are_unpacked(tmp_path: Path, kind: int) -> None:
    archive = write_entry(tmp_path / "link.zip", raw_entry("link", kind | 0o777), b"/etc/passwd")
    with pytest.raises(ImportFailed, match="'link' is a link or a device"):
        unpack_here(archive, tmp_path / "out", LIMITS)
    assert unpacked(tmp_path / "out") == {} if (tmp_path / "out").exists() else True


@pytest.mark.parametrize(("entries", "accepted"), [(3, True), (4, True), (5, False)])
def test_entries_are_limited(tmp_path: Path, entries: int, accepted: bool) -> None:
    archive = write_zip(tmp_path / "many.zip", {f"{number}": b"" for number in range(entries)})
    limits = replace(LIMITS, entries=4)
    if accepted:
        assert unpack_here(archive, tmp_path / "out", limits) == entries
    else:
        with pytest.raises(LimitExceeded, match="has 5 entries, at most 4"):
            unpack_here(archive, tmp_path / "out", limits)


@pytest.mark.parametrize(("size", "accepted"), [(9, True), (10, True), (11, False)])
def test_bytes_of_all_files_are_limited(tmp_path: Path, size: int, accepted: bool) -> None:
    archive = write_zip(tmp_path / "big.zip", {"a": b"1234", "b": b"x" * (size - 4)})
    limits = replace(LIMITS, bytes=10)
    if accepted:
        assert unpack_here(archive, tmp_path / "out", limits) == 2
    else:
        with pytest.raises(LimitExceeded, match="more than 10 bytes"):
            unpack_here(archive, tmp_path / "out", limits)


def test_bytes_are_counted_as_they_come_not_as_they_are_announced(tmp_path: Path) -> None:
    """The list of entries says 1 byte; the data are 5 MB."""
    archive = write_zip(tmp_path / "liar.zip", {"a": b"\0" * 5_000_000}, method=zipfile.ZIP_STORED)
    data = archive.read_bytes()
    true_size = (5_000_000).to_bytes(4, "little")
    archive.write_bytes(data.replace(true_size, (1).to_bytes(4, "little")))
    with pytest.raises((ImportFailed, LimitExceeded)):
        unpack_here(archive, tmp_path / "out", LIMITS)
    assert sum(len(file) for file in unpacked(tmp_path / "out").values()) <= 1 << 20


@pytest.mark.parametrize(("ratio", "accepted"), [(150, True), (20, False)])
def test_ratio_of_an_entry_is_limited(tmp_path: Path, ratio: int, accepted: bool) -> None:
    """A run of 3 MB between random bytes packs to about a thirtieth of its size."""
    import random

    noise = random.Random(7).randbytes(100_000)
    archive = write_zip(tmp_path / "bomb.zip", {"a": noise + bytes(3_000_000)})
    limits = replace(LIMITS, ratio=ratio)
    if accepted:
        assert unpack_here(archive, tmp_path / "out", limits) == 1
    else:
        with pytest.raises(LimitExceeded, match="grows to more than 20 times"):
            unpack_here(archive, tmp_path / "out", limits)
        assert sum(len(file) for file in unpacked(tmp_path / "out").values()) < 3_100_000


def test_small_entries_may_have_any_ratio(tmp_path: Path) -> None:
    archive = write_zip(tmp_path / "zeros.zip", {"a": bytes(1 << 20)})
    assert unpack_here(archive, tmp_path / "out", replace(LIMITS, ratio=2)) == 1


def test_default_ratio_refuses_a_bomb(tmp_path: Path) -> None:
    archive = write_zip(tmp_path / "bomb.zip", {"a": bytes(50_000_000)})
    with pytest.raises(LimitExceeded, match="grows to more than 200 times"):
        unpack(archive, tmp_path / "out", LIMITS, lambda *_: None)


@pytest.mark.parametrize(("length", "accepted"), [(9, True), (10, True), (11, False)])
def test_names_are_limited(tmp_path: Path, length: int, accepted: bool) -> None:
    archive = write_zip(tmp_path / "long.zip", {"n" * length: b"x"})
    limits = replace(LIMITS, name_bytes=10)
    if accepted:
        assert unpack_here(archive, tmp_path / "out", limits) == 1
    else:
        with pytest.raises(LimitExceeded, match="has 11 bytes, at most 10"):
            unpack_here(archive, tmp_path / "out", limits)


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_name_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "twice.zip", "w") as archive:
        archive.writestr("a", b"1")
        archive.writestr("a", b"2")
    with pytest.raises(ImportFailed, match="there twice"):
        unpack_here(tmp_path / "twice.zip", tmp_path / "out", LIMITS)


def test_file_that_is_also_a_folder_is_refused(tmp_path: Path) -> None:
    archive = write_zip(tmp_path / "both.zip", {"a": b"1", "a/b": b"2"})
    with pytest.raises(ImportFailed, match="cannot be unpacked"):
        unpack_here(archive, tmp_path / "out", LIMITS)


def test_encrypted_entry_is_refused(tmp_path: Path) -> None:
    archive = write_zip(tmp_path / "secret.zip", {"a": b"1"})
    data = bytearray(archive.read_bytes())
    for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.index(signature) + offset] |= 1
    archive.write_bytes(bytes(data))
    with pytest.raises(ImportFailed, match="encrypted"):
        unpack_here(archive, tmp_path / "out", LIMITS)


def test_archive_cut_off_or_changed_anywhere_is_refused_or_unpacked_but_never_crashes(tmp_path: Path) -> None:
    """A flipped bit may hit a time stamp, which changes nothing."""
    whole = write_zip(tmp_path / "whole.zip", {"a.txt": b"some text " * 50, "b/c.txt": b"more"}).read_bytes()
    damaged = [whole[:cut] for cut in range(0, len(whole), 7)]
    damaged += [whole[:at] + bytes([whole[at] ^ 0x41]) + whole[at + 1 :] for at in range(0, len(whole), 3)]
    for number, data in enumerate(damaged):
        path = tmp_path / "damaged.zip"
        path.write_bytes(data)
        folder = tmp_path / f"out{number}"
        with suppress(ImportFailed, LimitExceeded):
            unpack_here(path, folder, LIMITS)
        assert all(path.is_relative_to(folder) for path in folder.rglob("*"))


def test_errors_of_the_subprocess_keep_their_kind(tmp_path: Path) -> None:
    archive = write_zip(tmp_path / "many.zip", {"a": b"", "b": b""})
    with pytest.raises(LimitExceeded, match="has 2 entries"):
        unpack(archive, tmp_path / "out", replace(LIMITS, entries=1), lambda *_: None)
    (tmp_path / "text.zip").write_bytes(b"PK\x03\x04 no archive")
    with pytest.raises(ImportFailed, match=r"text\.zip: cannot be unpacked"):
        unpack(tmp_path / "text.zip", tmp_path / "out2", LIMITS, lambda *_: None)
