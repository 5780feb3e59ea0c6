"""Publishing again: only changed files are written or sent, and a visitor never sees a manifest whose files are missing."""

import json
import os
import shutil
import urllib.request
from hashlib import sha256

import pytest

from map3d.errors import AlreadyExists, BadRequest, StoreError, VerifyFailed
from map3d.object_store import ObjectStore, open_object_store
from map3d.publish import publish, publish_rendering
from map3d.publish.checksums import parse_checksums
from map3d.publish.store_target import IMMUTABLE, REVALIDATED
from map3d.registry import NewObject, Registry
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId
from map3d.verify.published_checks import verify_published
from tests.publish.hosts import public_address
from tests.web.workspaces import LAYERS, OCCUPIED, ZMAX, put_block


class Recorder(ObjectStore):
    """Passes requests on, notes those that write, and can fail at one of them."""

    def __init__(self, store, fail_at=None):
        self._store, self.puts, self.deletes, self.fail_at = store, [], [], fail_at
        self.broken = []

    def __getattr__(self, name):
        return getattr(self._store, name)

    url = property(lambda self: self._store.url)

    def list(self, prefix=""):
        return self._store.list(prefix)

    def get(self, name):
        return self._store.get(name)

    def put(self, name, data, **how):
        self._count()
        tag = self._store.put(name, data, **how)
        self.puts.append(name)
        self._look()
        return tag

    def delete(self, name):
        self._count()
        self._store.delete(name)
        self.deletes.append(name)
        self._look()

    def _count(self):
        if self.fail_at is not None and len(self.puts) + len(self.deletes) >= self.fail_at:
            raise StoreError("the network is gone")

    def _look(self):
        """Notes references to missing files, as a visitor would follow them."""
        found = self._store.get("rendering.json")
        for view in json.loads(found[0])["views"] if found else ():
            self.broken += [name for name in view["archives"].values() if not self._store.exists(name)]
        page = self._store.get("objects/search.json")
        self.broken += (
            [name for name in json.loads(page[0]).get("pages", ()) if not self._store.exists(f"objects/search/{name}.json")] if page else []
        )


@pytest.fixture
def opened(monkeypatch):
    """Records the stores that publish opens; `fail_at` of the list's last item applies to the next one."""
    stores = []

    def open_store(url):
        stores.append(Recorder(open_object_store(url), opened_fail["at"]))
        return stores[-1]

    opened_fail = {"at": None}
    monkeypatch.setattr(publish_rendering, "open_object_store", open_store)
    return stores, opened_fail


def contents(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def everything_but_locks(folder):
    """Returns all files apart from those that SQLite makes when a database is read."""
    return {name: data for name, data in contents(folder).items() if not name.endswith(("-shm", "-wal"))}


def stored(url):
    store = open_object_store(url)
    return {name: store.get(name)[0] for name, _ in store.list()}


def current(files):
    """Returns the files of the present publication, without those that stay for maps opened before it."""
    listed = parse_checksums(files["checksums.sha256"])
    return {name: data for name, data in files.items() if name in listed or name == "checksums.sha256"}


def change_a_view(workspace, salt="new"):
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        put_block(store, "0-45", BlockId(1, 0, 0), Occupancy.from_tiles(ZMAX, OCCUPIED), version=2, salt=salt)


def test_a_store_receives_the_files_of_a_folder(workspace, out, store_url, tmp_path):
    done = publish(workspace, "tea", store_url)
    publish(workspace, "tea", out)
    assert stored(store_url) == contents(out)
    assert (done.files, done.bytes, done.written) == (len(contents(out)), sum(map(len, contents(out).values())), len(contents(out)))
    assert not list(workspace.rendering_folder("tea").glob("publishing-*"))


def test_publishing_again_sends_nothing(workspace, store_url, opened):
    publish(workspace, "tea", store_url)
    done = publish(workspace, "tea", store_url)
    assert (opened[0][-1].puts, opened[0][-1].deletes) == ([], [])
    assert (done.written, done.kept, done.removed) == (0, 8, 0)


def test_a_change_sends_the_changed_files_and_the_manifest_last(workspace, out, store_url, opened):
    publish(workspace, "tea", store_url)
    before = stored(store_url)
    change_a_view(workspace)
    done = publish(workspace, "tea", store_url)
    publish(workspace, "tea", out)
    assert current(stored(store_url)) == contents(out)
    recorder = opened[0][-1]
    sent = [name for name in recorder.puts if name != "checksums.sha256"]
    assert len([name for name in sent if name.endswith(".pmtiles")]) == 4
    assert set(sent) - {"preview.jpg"} == {name for name in stored(store_url).keys() - before.keys() if name.endswith(".pmtiles")} | {
        "rendering.json"
    }
    assert sent[-1] == "rendering.json"
    assert recorder.puts[-1] == "checksums.sha256"
    assert recorder.broken == []
    assert stored(store_url).keys() > before.keys(), "a map opened before the change still finds its archives"
    assert (recorder.deletes, done.kept, done.removed) == ([], 4, 0)
    done = publish(workspace, "tea", store_url)
    assert stored(store_url) == contents(out)
    assert sorted(opened[0][-1].deletes) == sorted(before.keys() - contents(out).keys())
    assert (done.kept, done.removed) == (8, 4)


@pytest.mark.parametrize("first", [True, False])
def test_a_publication_stopped_at_any_request_is_completed_by_the_next(workspace, out, tmp_path, opened, first):
    stores, fail = opened
    publish(workspace, "tea", out)
    reference_before = contents(out)
    number = 0
    while True:
        url = (tmp_path / f"store{number}").as_uri()
        copy = type(workspace)(shutil.copytree(workspace.root, tmp_path / f"ws{number}"))
        fail["at"] = None
        if not first:
            publish(copy, "tea", url)
            assert stored(url) == reference_before
            change_a_view(copy)
            with Registry(copy.registry_path("town")) as registry:
                registry.put_asset("more", [NewObject("Tower", "building", box=((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), attributes={"new": 1})])
        fail["at"] = number
        try:
            publish(copy, "tea", url)
            break
        except StoreError:
            assert stores[-1].broken == []
        fail["at"] = None
        publish(copy, "tea", url)
        assert stores[-1].broken == []
        publish(copy, "tea", tmp_path / f"folder{number}")
        assert current(stored(url)) == contents(tmp_path / f"folder{number}")
        number += 5
    assert number > (25 if first else 15)


def test_a_change_that_is_undone_after_a_stop_is_sent(workspace, tmp_path, opened):
    """The files that were overwritten before the stop do not pass as the old ones."""
    _, fail = opened
    url = (tmp_path / "store").as_uri()
    publish(workspace, "tea", url)
    before = stored(url)
    saved = workspace.registry_path("town").read_bytes()
    with Registry(workspace.registry_path("town")) as registry:
        registry.put_asset("more", [NewObject("Tower", "building", box=((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))])
    fail["at"] = 4
    with pytest.raises(StoreError):
        publish(workspace, "tea", url)
    assert stored(url) != before
    workspace.registry_path("town").write_bytes(saved)
    for log in workspace.registry_path("town").parent.glob("registry.sqlite-*"):
        log.unlink()
    fail["at"] = None
    publish(workspace, "tea", url)
    assert stored(url) == before


def test_files_of_others_stay(workspace, tmp_path):
    url = (tmp_path / "store").as_uri()
    publish(workspace, "tea", url)
    store = open_object_store(url)
    store.put("thesis.txt", b"irreplaceable")
    store.put("objects/17.json", b"an old shard")
    publish(workspace, "tea", url)
    assert (store.exists("thesis.txt"), store.exists("objects/17.json")) == (True, False)
    other = (tmp_path / "other").as_uri()
    open_object_store(other).put("thesis.txt", b"irreplaceable")
    with pytest.raises(AlreadyExists, match="not a published rendering"):
        publish(workspace, "tea", other, replace=True)


def test_objects_have_types_and_caching(workspace, s3_endpoint, s3_url):
    publish(workspace, "tea", s3_url)
    base = public_address(s3_endpoint, s3_url, stored(s3_url))

    def headers(name):
        with urllib.request.urlopen(f"{base}/{name}", timeout=30) as answer:
            return answer.headers["content-type"], answer.headers["cache-control"]

    (archive,) = [name for name in stored(s3_url) if name.startswith("0-45/color-")]
    assert headers(archive) == ("application/vnd.pmtiles", IMMUTABLE)
    assert headers("rendering.json") == ("application/json", REVALIDATED)
    assert headers("index.html") == ("text/html; charset=utf-8", REVALIDATED)
    assert headers("preview.jpg") == ("image/jpeg", REVALIDATED)
    assert headers("assets/worker.js") == ("text/javascript; charset=utf-8", REVALIDATED)


def test_unchanged_files_of_a_folder_are_not_written_again(workspace, out):
    publish(workspace, "tea", out)
    before = {path: path.stat() for path in out.rglob("*") if path.is_file()}
    done = publish(workspace, "tea", out)
    assert (done.written, done.kept) == (0, 8)
    assert {path: path.stat().st_ino for path in out.rglob("*") if path.is_file()} == {path: stat.st_ino for path, stat in before.items()}
    change_a_view(workspace)
    done = publish(workspace, "tea", out)
    assert (done.kept, done.archives) == (4, 8)
    verify_published(out, workspace)
    publish(workspace, "tea", out.with_name("reference"))
    assert current(contents(out)) == contents(out.with_name("reference"))
    assert {path.relative_to(out) for path in before} < {path.relative_to(out) for path in out.rglob("*") if path.is_file()}
    publish(workspace, "tea", out)
    assert contents(out) == contents(out.with_name("reference"))


def test_a_stopped_draft_never_changes_the_published_folder(workspace, out):
    publish(workspace, "tea", out)
    before = contents(out)
    with Registry(workspace.registry_path("town")) as registry:
        registry.put_asset("more", [NewObject("Tower", "building", box=((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))])
    draft = out.with_name(".public.publishing")
    draft.mkdir()
    for name in before:
        (draft / name).parent.mkdir(parents=True, exist_ok=True)
        os.link(out / name, draft / name)
    publish(workspace, "tea", out, dry_run=True)
    assert contents(out) == before
    publish(workspace, "tea", out)
    assert contents(out) != before
    verify_published(out, workspace)


@pytest.mark.parametrize("again", [False, True])
def test_a_dry_run_tells_what_would_be_written(workspace, out, tmp_path, again):
    if again:
        publish(workspace, "tea", out)
        change_a_view(workspace)
    before = everything_but_locks(tmp_path)
    plan = publish(workspace, "tea", out, dry_run=True)
    assert everything_but_locks(tmp_path) == before
    done = publish(workspace, "tea", out)
    assert (plan.tiles, plan.archives, plan.removed, plan.kept) == (done.tiles, done.archives, done.removed, done.kept)
    assert plan.written == done.written - 1  # checksums.sha256 follows from the others
    assert {(row.part, row.view, row.layer) for row in plan.sizes} == {(row.part, row.view, row.layer) for row in done.sizes}


def test_the_size_report_adds_up_and_starts_with_the_largest(workspace, out):
    done = publish(workspace, "tea", out)
    assert sum(row.bytes for row in done.sizes) == done.bytes == sum(map(len, contents(out).values()))
    assert sum(row.files for row in done.sizes) == done.files
    assert [row.bytes for row in done.sizes] == sorted((row.bytes for row in done.sizes), reverse=True)
    tiles = {(row.view, row.layer) for row in done.sizes if row.part == "tiles"}
    assert tiles == {(view, layer.name) for view in ("0-45", "45-22.5") for layer in LAYERS}
    assert {row.part for row in done.sizes} == {"tiles", "objects", "search", "columns", "viewer", "other"}


def test_archives_are_named_by_their_content(workspace, out):
    publish(workspace, "tea", out)
    names = {path.name: sha256(path.read_bytes()).hexdigest() for path in out.rglob("*.pmtiles")}
    change_a_view(workspace)
    publish(workspace, "tea", out)
    after = {path.name: sha256(path.read_bytes()).hexdigest() for path in out.rglob("*.pmtiles")}
    assert names.items() <= after.items()
    publish(workspace, "tea", out)
    after = {path.name: sha256(path.read_bytes()).hexdigest() for path in out.rglob("*.pmtiles")}
    assert len(names.keys() & after.keys()) == 4
    assert all(names[name] == after[name] for name in names.keys() & after.keys())


PART_BYTES = 700


@pytest.mark.parametrize("kind", ["folder", "store"])
def test_archives_in_parts_hold_the_same_tiles_and_are_kept(workspace, tmp_path, monkeypatch, kind):
    monkeypatch.setattr(publish_rendering, "_check_size", lambda *_: None)
    out = tmp_path / "public"
    target = out if kind == "folder" else out.as_uri()
    done = publish(workspace, "tea", target, max_file_bytes=PART_BYTES)
    assert (done.archives, done.kept) == (8, 0)
    parts = sorted(out.rglob("*.pmtiles"))
    assert len(parts) > 16
    assert max(path.stat().st_size for path in parts) == PART_BYTES
    assert json.loads((out / "rendering.json").read_text())["archive_part_bytes"] == PART_BYTES
    verify_published(out, workspace)
    before = contents(out)
    done = publish(workspace, "tea", target, max_file_bytes=PART_BYTES)
    assert (done.written, done.kept, done.removed, contents(out)) == (0, 8, 0, before)
    assert publish(workspace, "tea", target, max_file_bytes=PART_BYTES, dry_run=True).kept == 8
    parts[-1].write_bytes(b"cut")
    with pytest.raises(VerifyFailed, match="bytes, expected"):
        verify_published(out, workspace)
    publish(workspace, "tea", target)
    verify_published(out, workspace)
    publish(workspace, "tea", target)
    assert not [path for path in out.rglob("*.pmtiles") if path.name.count(".") > 1]


def test_a_file_that_cannot_be_divided_is_named(workspace, out):
    with pytest.raises(BadRequest, match=r"has .* bytes, more than --max-file allows \(1,000\)"):
        publish(workspace, "tea", out, max_file_bytes=1000)
