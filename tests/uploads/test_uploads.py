"""Names, quota, disk, resumption and expiry of uploads."""

import errno
import os
import shutil
import threading
from pathlib import Path
from typing import NamedTuple

import pytest

from map3d.errors import BadRequest, LimitExceeded, NotFound
from map3d.uploads import DiskFull, OffsetConflict, UploadLimits, Uploads, WriteInProgress, check_path
from map3d.uploads import uploads as module
from map3d.uploads.upload_limits import QUOTA_VARIABLE, limits_from_environment


@pytest.fixture
def uploads(tmp_path: Path) -> Uploads:
    return Uploads(tmp_path / "uploads")


@pytest.mark.parametrize(
    ("path", "stored"),
    [
        ("town.gml", "town.gml"),
        ("city/textures/a b (1).jpg", "city/textures/a b (1).jpg"),
        ("city\\textures\\a.jpg", "city/textures/a.jpg"),
        ("Gebäude.gml", "Gebäude.gml"),
        ("Geba\u0308ude.gml", "Gebäude.gml"),
        ("都市.gml", "都市.gml"),
        ("a" * 251 + ".gml", "a" * 251 + ".gml"),
        ("/".join(["a"] * 32), "/".join(["a"] * 32)),
    ],
)
def test_accepted_names(path: str, stored: str) -> None:
    assert check_path(path) == stored


@pytest.mark.parametrize(
    "path",
    [
        "", "/", ".", "..", "../x", "a/../x", "a//b", "/etc/passwd", "a/", "C:\\x", "\\\\host\\x", "a\0b", "a\nb", "\ud800", "a\u202egml.exe",
        "a\u2028", " a", "a ", "a.", "a/. ", "x" * 256, "ä" * 128, "/".join(["a"] * 33), "/".join(["b" * 200] * 6), "a*", "nul\x7f",
    ],
)  # fmt: skip
def test_refused_names(path: str, uploads: Uploads) -> None:
    with pytest.raises(BadRequest, match="file name"):
        uploads.create("anna", path, 1)
    assert not list(uploads.folder.glob("*"))


def test_pieces_make_the_file_also_with_another_process_between(uploads: Uploads) -> None:
    data = os.urandom(5_000)
    made = uploads.create("anna", "city/a.gml", len(data), "b1")
    for start in range(0, len(data), 1_000):
        again = Uploads(uploads.folder)
        assert again.get(made.id, "anna").offset == start
        with again.write(made.id, "anna", start) as writer:
            writer.write(data[start : start + 1_000])
    found = uploads.get(made.id, "anna")
    assert (found.complete, found.name, found.batch) == (True, "city/a.gml", "b1")
    assert (uploads.folder / made.id / "data").read_bytes() == data
    assert [one.id for one in uploads.batch("b1", "anna")] == [made.id]


def test_piece_at_the_wrong_place_is_refused(uploads: Uploads) -> None:
    made = uploads.create("anna", "a", 10)
    with uploads.write(made.id, "anna", 0) as writer:
        writer.write(b"12345")
    for offset in (0, 4, 6, 10):
        with pytest.raises(OffsetConflict, match="5 bytes have arrived"):
            uploads.write(made.id, "anna", offset)


def test_only_one_request_writes(uploads: Uploads) -> None:
    made = uploads.create("anna", "a", 10)
    with uploads.write(made.id, "anna", 0), pytest.raises(WriteInProgress):
        Uploads(uploads.folder).write(made.id, "anna", 0)
    uploads.write(made.id, "anna", 0).close()


def test_more_than_announced_is_refused(uploads: Uploads) -> None:
    made = uploads.create("anna", "a", 3)
    with uploads.write(made.id, "anna", 0) as writer, pytest.raises(BadRequest, match="announced 3 bytes"):
        writer.write(b"12345")
    assert (uploads.folder / made.id / "data").read_bytes() == b"123"


def test_users_do_not_see_each_others_uploads(uploads: Uploads) -> None:
    made = uploads.create("anna", "a", 3, "b")
    for call in (lambda: uploads.get(made.id, "ben"), lambda: uploads.write(made.id, "ben", 0), lambda: uploads.remove(made.id, "ben")):
        with pytest.raises(NotFound):
            call()
    assert uploads.batch("b", "ben") == []


@pytest.mark.parametrize("id", ["", "x", "../../etc", "0" * 15, "0" * 17, "A" * 16, "0" * 16, "٠" * 16])
def test_unknown_ids(uploads: Uploads, id: str) -> None:
    with pytest.raises(NotFound):
        uploads.get(id, "anna")


@pytest.mark.parametrize(("size", "accepted"), [(39, True), (40, True), (41, False)])
def test_quota_counts_what_is_announced(tmp_path: Path, size: int, accepted: bool) -> None:
    uploads = Uploads(tmp_path, UploadLimits(quota_bytes=100, spare_bytes=0))
    uploads.create("ben", "a", 60)
    if accepted:
        uploads.create("anna", "b", size)
    else:
        with pytest.raises(LimitExceeded, match=rf"60 bytes of the quota of 100 bytes.*{QUOTA_VARIABLE}"):
            uploads.create("anna", "b", size)


def test_removal_frees_the_quota(tmp_path: Path) -> None:
    uploads = Uploads(tmp_path, UploadLimits(quota_bytes=100, spare_bytes=0))
    for _ in range(3):
        uploads.remove(uploads.create("anna", "a", 100).id, "anna")
    assert list(tmp_path.iterdir()) == []


def test_number_of_files_is_limited(tmp_path: Path) -> None:
    uploads = Uploads(tmp_path, UploadLimits(files=2))
    for name in ("a", "b"):
        uploads.create("anna", name, 1)
    with pytest.raises(LimitExceeded, match="2 files"):
        uploads.create("anna", "c", 1)


class Usage(NamedTuple):
    total: int
    used: int
    free: int


@pytest.mark.parametrize(("size", "accepted"), [(29, True), (30, True), (31, False)])
def test_disk_space_counts_what_has_not_arrived(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int, accepted: bool) -> None:
    monkeypatch.setattr(module.shutil, "disk_usage", lambda _: Usage(1000, 890, 110))
    uploads = Uploads(tmp_path, UploadLimits(spare_bytes=20))
    uploads.create("anna", "a", 60)
    if accepted:
        uploads.create("anna", "b", size)
    else:
        with pytest.raises(DiskFull, match="room for 30 bytes more"):
            uploads.create("anna", "b", size)


def test_full_disk_keeps_what_arrived(uploads: Uploads, monkeypatch: pytest.MonkeyPatch) -> None:
    made = uploads.create("anna", "a", 10)
    real = os.write

    def write(file: int, data: bytes) -> int:
        if len(data) < 5:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(file, bytes(data[:2]))

    monkeypatch.setattr(module.os, "write", write)
    with uploads.write(made.id, "anna", 0) as writer, pytest.raises(DiskFull, match="resume"):
        writer.write(b"123456")
    assert uploads.get(made.id, "anna").offset == 2
    monkeypatch.undo()
    with uploads.write(made.id, "anna", 2) as writer:
        writer.write(b"34567890")
    assert (uploads.folder / made.id / "data").read_bytes() == b"1234567890"


def test_discarded_piece_is_gone(uploads: Uploads) -> None:
    made = uploads.create("anna", "a", 10)
    with uploads.write(made.id, "anna", 0) as writer:
        writer.write(b"123")
    with uploads.write(made.id, "anna", 3) as writer:
        writer.write(b"xyz")
        writer.discard()
    assert (uploads.folder / made.id / "data").read_bytes() == b"123"


def test_write_after_close_does_nothing(uploads: Uploads) -> None:
    """The connection may break while another thread writes."""
    made = uploads.create("anna", "a", 10)
    writer = uploads.write(made.id, "anna", 0)
    threads = [threading.Thread(target=writer.close), threading.Thread(target=writer.write, args=(b"1",))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    writer.close()
    writer.write(b"2")
    assert (uploads.folder / made.id / "data").read_bytes() in (b"", b"1")


def test_abandoned_uploads_expire_unless_they_are_in_use(uploads: Uploads) -> None:
    old, used, fresh = (uploads.create("anna", name, 5) for name in "abc")
    draft = uploads.folder / ".new-killed"
    draft.mkdir()
    for path in (uploads.folder / old.id / "data", uploads.folder / used.id / "data", draft):
        os.utime(path, (1, 1))
    assert uploads.remove_expired(frozenset([used.id])) == 1
    assert sorted(path.name for path in uploads.folder.iterdir()) == sorted([used.id, fresh.id])


def test_removed_while_it_is_written(uploads: Uploads) -> None:
    made = uploads.create("anna", "a", 5)
    with uploads.write(made.id, "anna", 0) as writer:
        writer.write(b"12")
        shutil.rmtree(uploads.folder / made.id)
        writer.write(b"345")
    with pytest.raises(NotFound):
        uploads.get(made.id, "anna")


@pytest.mark.parametrize(("text", "size"), [("5", 5), ("2k", 2048), ("1.5G", 3 << 29), ("2TiB", 2 << 40)])
def test_quota_from_the_environment(monkeypatch: pytest.MonkeyPatch, text: str, size: int) -> None:
    monkeypatch.setenv(QUOTA_VARIABLE, text)
    assert limits_from_environment().quota_bytes == size


@pytest.mark.parametrize("text", ["much", "-1", "1X", "٣"])
def test_invalid_quota_is_refused(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv(QUOTA_VARIABLE, text)
    with pytest.raises(BadRequest, match="500G"):
        limits_from_environment()
