"""Stored views: a quota that is kept before writing, least recently used out, across restarts and processes; removed with their scenes."""

from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.database import Database
from map3d.errors import BadRequest
from map3d.renderings import view_store
from map3d.renderings.view_store import OVERHEAD_BYTES, ViewStore, remove_views, store_limit_bytes, views_folder

SIZE = 10_000
COST = SIZE + OVERHEAD_BYTES


def key(number: int) -> str:
    return f"{number:048x}"


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ViewStore:
    monkeypatch.setattr(view_store, "MARK_S", 0.0)
    return ViewStore(tmp_path / "views", 10 * COST)


def files(store: ViewStore) -> int:
    return sum(path.stat().st_size for path in store._folder.glob("??/*"))


def test_the_limit_is_never_exceeded(store: ViewStore) -> None:
    for number in range(40):
        store.put(key(number), bytes([number]) * SIZE, ["town"])
        assert store.used_bytes() <= store.limit_bytes
        assert files(store) <= store.limit_bytes
    assert [number for number in range(40) if store.get(key(number))] == list(range(30, 40))


def test_least_recently_used_views_go_first(store: ViewStore) -> None:
    for number in range(10):
        store.put(key(number), b"x" * SIZE, ["town"])
    assert store.get(key(0))
    assert store.get(key(3))
    for number in range(10, 18):
        store.put(key(number), b"x" * SIZE, ["town"])
    assert [number for number in range(10) if store.get(key(number))] == [0, 3]


def test_a_view_larger_than_an_eighth_is_not_stored(store: ViewStore) -> None:
    most = 10 * COST // 8 - OVERHEAD_BYTES
    for size, stored in ((most - 1, True), (most, True), (most + 1, False)):
        store.put(key(size), b"x" * size, ["town"])
        assert (store.get(key(size)) is not None) == stored


def test_views_survive_a_restart(store: ViewStore) -> None:
    store.put(key(1), b"picture", ["town"])
    store.close()
    again = ViewStore(store._folder, store.limit_bytes)
    assert again.get(key(1)) == b"picture"
    assert again.used_bytes() == len(b"picture") + OVERHEAD_BYTES


def test_a_missing_file_is_stored_again(store: ViewStore) -> None:
    store.put(key(1), b"picture", ["town"])
    store._path(key(1)).unlink()
    assert store.get(key(1)) is None
    store.put(key(1), b"picture", ["town"])
    assert store.get(key(1)) == b"picture"
    assert store.used_bytes() == len(b"picture") + OVERHEAD_BYTES


def test_the_limit_comes_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(view_store.LIMIT_VARIABLE, "0.5")
    assert store_limit_bytes() == 500_000_000
    for bad in ("-1", "many", "nan"):
        monkeypatch.setenv(view_store.LIMIT_VARIABLE, bad)
        with pytest.raises(BadRequest, match=view_store.LIMIT_VARIABLE):
            store_limit_bytes()


# -- scenes -----------------------------------------------------------------------------------------------------------------------------


def stored(store: ViewStore, count: int = 9) -> list[int]:
    return [number for number in range(count) if store.get(key(number)) is not None]


def test_a_removed_scene_takes_its_views_along(store: ViewStore) -> None:
    for number, scenes in enumerate((["town"], ["village"], ["town", "village"], ["village"])):
        store.put(key(number), b"x" * SIZE, scenes)
    store.remove_scene("town")
    assert stored(store) == [1, 3]
    assert store.used_bytes() == 2 * COST
    assert files(store) == 2 * SIZE
    store.remove_scene("town")
    store.keep_scenes(["town"])
    assert (stored(store), store.used_bytes(), files(store)) == ([], 0, 0)


def test_a_view_of_a_scene_that_is_removed_meanwhile_is_not_stored(store: ViewStore) -> None:
    store.put(key(1), b"picture", ["town"], lambda: False)
    assert (stored(store), store.used_bytes(), files(store)) == ([], 0, 0)


def test_evicted_views_leave_nothing_behind(store: ViewStore) -> None:
    for number in range(20):
        store.put(key(number), b"x" * SIZE, ["town"])
    with store._database.reading() as db:
        assert db.execute("SELECT count(*) FROM view_scene").fetchone()[0] == 10


def test_views_of_an_older_version_go_with_the_first_scene(tmp_path: Path) -> None:
    folder = tmp_path / "views"
    folder.mkdir()
    old = Database(folder / "views.sqlite", view_store._SCHEMA.removesuffix(view_store._SCENES), 1)
    with old.transaction() as db:
        db.execute("INSERT INTO view VALUES (?, ?, 0, 0)", (key(0), COST))
        db.execute("UPDATE total SET bytes = ?", (COST,))
    old.close()
    (folder / key(0)[:2]).mkdir()
    (folder / key(0)[:2] / key(0)).write_bytes(b"x" * SIZE)
    store = ViewStore(folder, 10 * COST)
    store.put(key(1), b"x" * SIZE, ["town"])
    assert stored(store) == [0, 1]
    store.remove_scene("village")
    assert (stored(store), store.used_bytes()) == ([1], COST)


def test_views_are_removed_in_the_workspace(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path / "ws").create()
    remove_views(workspace, "town")
    assert not views_folder(workspace).exists(), "no store is created"
    store = ViewStore(views_folder(workspace), 10 * COST)
    store.put(key(1), b"x" * SIZE, ["town"])
    remove_views(workspace, "town")
    assert (stored(store), store.used_bytes()) == ([], 0)
