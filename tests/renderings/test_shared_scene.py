"""A scene that one host builds and other nodes fetch: complete, once, checked, within a limit."""

import json
import multiprocessing
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import Catalogue, SceneRecord, Workspace
from map3d.errors import BadRequest, Corrupt, LimitExceeded, NotFound
from map3d.geometry.core_frame import core_frame
from map3d.geometry.frames import pin
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import import_file
from map3d.ingest.sources import find_sources
from map3d.lifecycle import remove_scene as remove_scene_module
from map3d.lifecycle.remove_scene import find_scene, finish_scene_removal, remove_scene
from map3d.object_store import ObjectStore, open_object_store
from map3d.registry import Registry
from map3d.scenes import scene_cache
from map3d.scenes.build import BUILD_BYTES, build, is_stale, open_scene
from map3d.scenes.scene_cache import LIMIT_VARIABLE, scene_in_use
from map3d.scenes.shared_scene import read_shared, remove_shared
from map3d.types import ViewAngles
from tests.cli.towns import house


class Host:
    """The host that imports and builds, and the catalogue that all nodes share."""

    def __init__(self, root: Path, url: str) -> None:
        self.root, self.url = root, url
        self.workspace = Workspace(root / "host").create()
        self.catalogue: Catalogue = self.workspace.open_catalogue()

    def build(self, name: str = "town", height: float = 9.0) -> SceneRecord:
        """Builds a scene with a house of this height and another one far away, in a chunk of its own."""
        if name not in [scene.name for scene in self.catalogue.scenes()]:
            self.catalogue.create_scene(SceneRecord(name, options={"files": self.url, "ground_plane": "off"}))
        for number, text in enumerate((house(0.0, 0.0, height), house(9000.0, 0.0, 5.0))):
            path = self.root / f"{name}-{number}.obj"
            path.write_text(text)
            import_file(self.workspace, self.catalogue, name, find_sources([path])[0], ImportOptions())
        build(self.workspace, self.catalogue, name, threads=1, max_memory_bytes=BUILD_BYTES)
        return self.catalogue.scene(name)


@pytest.fixture
def host(tmp_path: Path, store_url: str) -> Iterator[Host]:
    made = Host(tmp_path, store_url)
    yield made
    made.catalogue.close()


@pytest.fixture
def node(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path / "node").create()


def keys(workspace: Workspace) -> list[str]:
    """Returns the keys of blocks that show both houses: they depend on every file of the scene."""
    scene = open_scene(workspace, "town")
    frame = core_frame(pin(scene.box, 256, 1.0, [ViewAngles(0, 45)])[0].to_json())
    return scene.block_keys(frame, 0, np.array([[0, 0]], np.uint32))


def built_files(workspace: Workspace, scene: str = "town") -> dict[str, bytes]:
    folder = workspace.scene_folder(scene)
    names = [folder / "scene.json", *folder.glob("chunks/*.m3c"), *folder.glob("instances.m3i"), *folder.glob("textures/*/*.m3t")]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in names if path.is_file()}


def size_of(*records: SceneRecord) -> int:
    """Returns the size of the scenes' files, equal ones once."""
    return sum({file.hash: file.size for record in records for file in read_shared(record).files.values()}.values())


def set_limit(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    monkeypatch.setenv(LIMIT_VARIABLE, repr(size / 1e9))


def test_a_node_gets_the_built_scene(host: Host, node: Workspace) -> None:
    record = host.build()
    assert len(built_files(host.workspace)) >= 3
    with scene_in_use(node, record) as folder:
        assert folder == node.scene_folder("town")
        assert built_files(node) == built_files(host.workspace)
        assert keys(node) == keys(host.workspace)
        with Registry(node.registry_path("town")) as copy, Registry(host.workspace.registry_path("town")) as registry:
            assert list(copy.objects()) == list(registry.objects())
    assert not is_stale(node, host.catalogue, "town")
    with pytest.raises(BadRequest, match="another host"):
        build(node, host.catalogue, "town", threads=1, max_memory_bytes=BUILD_BYTES)


def test_the_host_that_builds_uses_its_own_files(host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    record = host.build()
    monkeypatch.setattr(scene_cache, "fetch_scene", None)
    with scene_in_use(host.workspace, record) as folder:
        assert folder == host.workspace.scene_folder("town")


def test_a_current_copy_needs_no_object_store(host: Host, node: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    record = host.build()
    with scene_in_use(node, record):
        pass
    monkeypatch.setattr(scene_cache, "open_object_store", None)
    with scene_in_use(node, record):
        assert built_files(node)


def test_a_new_build_uploads_and_fetches_only_what_changed(host: Host, node: Workspace) -> None:
    first = host.build()
    with scene_in_use(node, first):
        before = {name: node.scene_folder("town").joinpath(name).stat().st_ino for name in built_files(node)}
    store = open_object_store(f"{host.url}/town")
    stored = {name: store.entity_tag(name) for name, _ in store.list("files")}
    second = host.build(height=14.0)
    assert second.built != first.built
    kept = {name: tag for name, tag in stored.items() if store.entity_tag(name) == tag}
    assert kept == stored, "nodes may still render the previous build"
    with scene_in_use(node, second):
        assert built_files(node) == built_files(host.workspace)
        after = {name: node.scene_folder("town").joinpath(name).stat().st_ino for name in built_files(node)}
    assert {name for name in before if before[name] == after.get(name)}, "unchanged chunks stay"


def test_files_of_builds_before_the_previous_one_are_deleted(host: Host, node: Workspace) -> None:
    for height in (6.0, 7.0, 8.0, 9.0, 10.0):
        record = host.build(height=height)
    store = open_object_store(f"{host.url}/town")
    assert len(list(store.list("builds"))) == 2
    shared = read_shared(record)
    assert len(list(store.list("files"))) <= 2 * len(shared.files)
    with scene_in_use(node, record):
        assert keys(node) == keys(host.workspace)
    remove_shared(f"{host.url}/town")
    assert list(store.list()) == []
    with pytest.raises(NotFound, match="map3d render"):
        read_shared(record)


def test_a_removed_scene_leaves_nothing_in_the_object_store(host: Host) -> None:
    host.build()
    removal = find_scene(host.workspace, host.catalogue, "town", with_renderings=False)
    assert removal.shared == f"{host.url}/town"
    remove_scene(host.workspace, host.catalogue, removal)
    assert list(open_object_store(host.url).list()) == []
    assert host.catalogue.scenes() == []


def test_a_killed_removal_of_a_shared_scene_is_completed(host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    host.build()
    with monkeypatch.context() as killed:
        killed.setattr(remove_scene_module, "remove_shared", None)
        with pytest.raises(TypeError):
            remove_scene(host.workspace, host.catalogue, find_scene(host.workspace, host.catalogue, "town", with_renderings=False))
    finish_scene_removal(host.workspace, host.catalogue, "town")
    assert list(open_object_store(host.url).list()) == []


def _fetch_and_log(root: Path, record: SceneRecord, log: Path, start: "multiprocessing.synchronize.Barrier") -> None:
    read_parts = scene_cache._read_parts

    def logged(store: ObjectStore, name: str, draft: Path) -> None:
        with log.open("a") as file:
            file.write(f"{os.getpid()} {name}\n")
        read_parts(store, name, draft)

    scene_cache._read_parts = logged
    start.wait()
    with scene_in_use(Workspace(root), record):
        assert built_files(Workspace(root))


def test_processes_that_start_together_fetch_each_file_once(host: Host, node: Workspace, tmp_path: Path) -> None:
    record, log, spawn = host.build(), tmp_path / "log", multiprocessing.get_context("spawn")
    start = spawn.Barrier(3)
    processes = [spawn.Process(target=_fetch_and_log, args=(node.root, record, log, start)) for _ in range(3)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    assert [process.exitcode for process in processes] == [0, 0, 0]
    read = [line.split() for line in log.read_text().splitlines()]
    assert len({pid for pid, _ in read}) == 1
    assert len(read) == len({name for _, name in read}) == len({file.hash for file in read_shared(record).files.values()})


@pytest.mark.parametrize("answers", ["one is cut", "all are cut"])
def test_a_cut_answer_is_read_again(host: Host, node: Workspace, monkeypatch: pytest.MonkeyPatch, answers: str) -> None:
    record, read_parts, cut = host.build(), scene_cache._read_parts, set()

    def cutting(store: ObjectStore, name: str, draft: Path) -> None:
        read_parts(store, name, draft)
        if answers == "all are cut" or name not in cut:
            cut.add(name)
            draft.write_bytes(draft.read_bytes()[:-1])

    monkeypatch.setattr(scene_cache, "_read_parts", cutting)
    if answers == "one is cut":
        with scene_in_use(node, record):
            assert built_files(node) == built_files(host.workspace)
    else:
        with pytest.raises(Corrupt, match="does not match its hash"), scene_in_use(node, record):
            pass
        assert not (node.scene_folder("town") / "scene.json").exists()
    assert not list(node.root.rglob("*.new"))


def test_large_files_are_read_in_parts(host: Host, node: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    record = host.build()
    monkeypatch.setattr(scene_cache, "PART_BYTES", 1000)
    with scene_in_use(node, record):
        assert built_files(node) == built_files(host.workspace)


def test_a_killed_fetch_is_completed_by_the_next(host: Host, node: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    record = host.build()
    with monkeypatch.context() as killed:
        killed.setattr(scene_cache, "_place", None)
        with pytest.raises(TypeError), scene_in_use(node, record):
            pass
    monkeypatch.setattr(scene_cache, "_download", None)
    with scene_in_use(node, record):
        assert built_files(node) == built_files(host.workspace)


def test_the_least_recently_used_scene_leaves_a_full_cache(host: Host, node: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two, three = host.build("one", 6.0), host.build("two", 7.0), host.build("three", 8.0)
    limit = size_of(one, two, three) - 1
    set_limit(monkeypatch, limit)
    for record in (one, two, one):
        with scene_in_use(node, record):
            pass
    with scene_in_use(node, three):
        assert built_files(node, "three") == built_files(host.workspace, "three")
    assert not node.scene_folder("two").exists()
    assert built_files(node, "one") == built_files(host.workspace, "one")
    cached = [*(node.root / ".scene-files").glob("*/*"), *node.root.glob("scenes/*/registry.sqlite")]
    assert sum(path.stat().st_size for path in cached) <= limit


def test_a_scene_in_use_is_never_removed(host: Host, node: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = host.build("one", 6.0), host.build("two", 7.0)
    set_limit(monkeypatch, size_of(one, two) - 1)
    with scene_in_use(node, one):
        with pytest.raises(LimitExceeded, match="in use"), scene_in_use(node, two):
            pass
        assert built_files(node, "one") == built_files(host.workspace, "one")
    with scene_in_use(node, two):
        assert not node.scene_folder("one").exists()


def test_a_scene_larger_than_the_limit_is_refused(host: Host, node: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    record = host.build()
    set_limit(monkeypatch, size_of(record) - 1)
    with pytest.raises(LimitExceeded, match=LIMIT_VARIABLE), scene_in_use(node, record):
        pass
    set_limit(monkeypatch, size_of(record))
    with scene_in_use(node, record):
        assert built_files(node)
    monkeypatch.setenv(LIMIT_VARIABLE, "much")
    with pytest.raises(BadRequest, match="positive"):
        scene_cache.cache_limit_bytes()


@pytest.mark.parametrize("name", ["../../outside", "/etc/passwd", "assets/a/mesh.m3a", "chunks/../../x.m3c", "textures/aa/../x.m3t"])
def test_an_index_cannot_name_other_files(host: Host, node: Workspace, name: str) -> None:
    record = host.build()
    store = open_object_store(f"{host.url}/town")
    found = store.get(f"builds/{record.built}.json")
    assert found is not None
    value = json.loads(found[0])
    value["files"][name] = value["files"]["scene.json"]
    store.put(f"builds/{record.built}.json", json.dumps(value).encode())
    with pytest.raises(Corrupt, match="not a file of a built scene"), scene_in_use(node, record):
        pass
