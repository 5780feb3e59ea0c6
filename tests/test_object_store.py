"""The tests that every object store passes."""

import logging
import os
import threading
from pathlib import Path

import pytest

from map3d.errors import BadRequest, ObjectChanged, StoreError
from map3d.object_store import ObjectStore, check_store_url, join_url, open_object_store
from map3d.object_store.folder import DRAFT_AGE_S, FolderStore


@pytest.fixture
def store(store_url: str) -> ObjectStore:
    return open_object_store(store_url)


def test_missing_objects_are_none(store: ObjectStore) -> None:
    assert store.get("a/b") is None
    assert store.get_range("a/b", 0, 4) is None
    assert store.get_start("a/b", 4) is None
    assert store.entity_tag("a/b") is None
    assert not store.exists("a/b")
    assert list(store.list()) == []
    store.delete("a/b")


@pytest.mark.parametrize("data", [b"", b"x", bytes(range(256)) * 50_000])
def test_objects_read_back(store: ObjectStore, data: bytes) -> None:
    tag = store.put("folder/object", data)
    assert store.get("folder/object") == (data, tag)
    assert store.entity_tag("folder/object") == tag
    assert store.exists("folder/object")
    assert list(store.list()) == [("folder/object", len(data))]


def test_files_are_written_as_objects(store: ObjectStore, tmp_path: Path) -> None:
    data = os.urandom(12 << 20)
    (tmp_path / "large").write_bytes(data)
    store.put("large", tmp_path / "large", headers={"Content-Type": "application/octet-stream", "Cache-Control": "max-age=60"})
    found = store.get("large")
    assert found is not None
    assert found[0] == data
    tag = store.entity_tag("large")
    store.put("large", tmp_path / "large", if_match=tag)
    assert store.get_range("large", 11 << 20, 1 << 20) == data[11 << 20 :]


def test_ranges_are_exact(store: ObjectStore) -> None:
    tag = store.put("o", b"0123456789")
    assert store.get_range("o", 3, 4) == b"3456"
    assert store.get_range("o", 9, 1) == b"9"
    assert store.get_start("o", 4) == (b"0123", tag, 10)
    assert store.get_start("o", 100) == (b"0123456789", tag, 10)
    with pytest.raises(StoreError):
        store.get_range("o", 8, 4)


def test_a_range_of_a_replaced_object_is_refused(store: ObjectStore) -> None:
    first = store.put("o", b"0123456789")
    assert store.get_range("o", 3, 4, if_match=first) == b"3456"
    second = store.put("o", b"9876543210")
    with pytest.raises(ObjectChanged):
        store.get_range("o", 3, 4, if_match=first)
    assert store.get_range("o", 3, 4, if_match=second) == b"6543"
    store.delete("o")
    assert store.get_range("o", 3, 4, if_match=second) is None


def test_a_write_replaces_the_object_and_its_tag(store: ObjectStore) -> None:
    first = store.put("o", b"first")
    second = store.put("o", b"other")
    assert first != second
    assert store.get("o") == (b"other", second)


def test_a_write_if_absent_keeps_an_existing_object(store: ObjectStore) -> None:
    tag = store.put("o", b"first", if_absent=True)
    with pytest.raises(ObjectChanged):
        store.put("o", b"second", if_absent=True)
    assert store.get("o") == (b"first", tag)
    assert store.put("o", b"first", if_absent=True) == tag


def test_a_write_if_match_refuses_a_changed_object(store: ObjectStore) -> None:
    first = store.put("o", b"first")
    second = store.put("o", b"second", if_match=first)
    with pytest.raises(ObjectChanged):
        store.put("o", b"third", if_match=first)
    assert store.get("o") == (b"second", second)
    store.delete("o")
    with pytest.raises(ObjectChanged):
        store.put("o", b"third", if_match=second)
    assert store.get("o") is None


def test_a_repeated_conditional_write_succeeds(store: ObjectStore) -> None:
    """The answer to the first write may have been lost."""
    first = store.put("o", b"first")
    second = store.put("o", b"second", if_match=first)
    assert store.put("o", b"second", if_match=first) == second


def test_lists_are_limited_to_a_folder(store: ObjectStore) -> None:
    for name in ("a/1", "a/b/2", "ab/3", "c"):
        store.put(name, name.encode())
    assert sorted(store.list()) == [("a/1", 3), ("a/b/2", 5), ("ab/3", 4), ("c", 1)]
    assert sorted(store.list("a")) == [("a/1", 3), ("a/b/2", 5)]
    assert list(store.list("nothing")) == []


def test_long_lists_are_complete(store: ObjectStore) -> None:
    names = [f"many/{number:04d}" for number in range(1203)]
    threads = [threading.Thread(target=lambda part: [store.put(name, b"x") for name in part], args=(names[start::4],)) for start in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [name for name, _ in store.list("many")] == names


def test_of_concurrent_writers_each_update_counts_once(store: ObjectStore) -> None:
    store.put("count", b"0")

    def add() -> None:
        for _ in range(5):
            while True:
                data, tag = store.get("count") or (b"", "")
                try:
                    store.put("count", b"%d %d" % (int(data.split()[0]) + 1, threading.get_ident()), if_match=tag)
                except ObjectChanged:
                    continue
                break

    threads = [threading.Thread(target=add) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found = store.get("count")
    assert found is not None
    assert int(found[0].split()[0]) == 20


def test_deleting_other_objects_does_not_disturb_conditional_writers(store: ObjectStore) -> None:
    store.put("one/count", b"0")
    over = threading.Event()

    def disturb() -> None:
        while not over.is_set():
            for name in ("one/other", "two/only"):
                store.put(name, b"x", if_absent=True)
                store.delete(name)

    def add() -> None:
        for _ in range(10):
            while True:
                data, tag = store.get("one/count") or (b"", "")
                store.put("two/more", b"x")
                store.delete("two/more")
                try:
                    store.put("one/count", b"%d %d" % (int(data.split()[0]) + 1, threading.get_ident()), if_match=tag)
                except ObjectChanged:
                    continue
                break

    writers = [threading.Thread(target=add) for _ in range(3)]
    threads = [*writers, threading.Thread(target=disturb)]
    for thread in threads:
        thread.start()
    for thread in writers:
        thread.join()
    over.set()
    threads[-1].join()
    found = store.get("one/count")
    assert found is not None
    assert int(found[0].split()[0]) == 30


@pytest.mark.parametrize("name", ["", "/a", "a/", "a//b", "../a", "a/../b", ".hidden", "a/.lock", "a\\b", "a\x00", "x" * 901])
def test_names_never_leave_the_store(store: ObjectStore, name: str) -> None:
    with pytest.raises(BadRequest, match="object name"):
        store.put(name, b"x")


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("s3://KEY:SECRET@bucket/prefix", "no user"),
        ("s3://bucket/prefix?X-Amz-Signature=SECRET", "no user"),
        ("az://account/container#SECRET", "no user"),
        ("ftp://host/folder", "unknown scheme"),
        ("/srv/tiles", "unknown scheme"),
        ("file://host/folder", "absolute"),
        ("file:tiles", "absolute"),
        ("s3:///prefix", "bucket"),
    ],
)
def test_invalid_urls_are_refused_without_repeating_secrets(url: str, says: str) -> None:
    with pytest.raises(BadRequest, match=says) as caught:
        open_object_store(url)
    assert "SECRET" not in str(caught.value)


def test_urls_are_joined_and_cleaned() -> None:
    assert check_store_url("s3://bucket/a/") == "s3://bucket/a"
    assert check_store_url("s3://bucket/") == "s3://bucket"
    assert join_url("file:///srv/tiles", "view", "0-45") == "file:///srv/tiles/view/0-45"


def test_errors_and_logs_contain_no_credentials(s3_url: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "very-secret")
    store = open_object_store("s3://no-such-bucket/x")
    with caplog.at_level(logging.DEBUG), pytest.raises(StoreError, match="s3://no-such-bucket/x") as caught:
        store.put("a", b"x")
    assert "very-secret" not in f"{caught.value} {caught.value.__cause__} {caplog.text} {store.url} {store!r}"


def test_a_folder_ignores_and_removes_drafts_of_killed_writers(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    store.put("a/o", b"x")
    fresh, old = tmp_path / "a" / ".o.0.new", tmp_path / "a" / ".o.1.new"
    for draft in (fresh, old):
        draft.write_bytes(b"half")
    os.utime(old, (0, 0))
    assert list(store.list()) == [("a/o", 1)]
    store.remove_drafts()
    assert fresh.exists()
    assert not old.exists()
    assert DRAFT_AGE_S > 3600


def test_a_folder_keeps_the_object_when_a_write_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = FolderStore(tmp_path)
    store.put("o", b"first")

    def fail(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(StoreError, match="No space left"):
        store.put("o", b"second")
    assert [path.name for path in tmp_path.iterdir()] == ["o"]
    assert store.get("o") is not None


def test_deleting_the_last_object_removes_its_folders(tmp_path: Path) -> None:
    store = FolderStore(tmp_path / "root")
    tag = store.put("a/b/o", b"x")
    store.put("a/b/o", b"y", if_match=tag)
    store.delete("a/b/o")
    assert list((tmp_path / "root").iterdir()) == []
