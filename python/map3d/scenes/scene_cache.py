"""A node's cache of shared scenes: fetches each file once per node, by hash, and keeps the scenes that were used last within a limit.

`.scene-files/<aa>/<hash>` has every file once; the folders of scenes have hard links to them, and a registry of their own. The file `.fetched` marks
a fetched scene; its time is that of the last use. A process that uses a scene holds a shared lock on `scenes/.NAME.use`, so that the scene is not
removed meanwhile.
"""

import fcntl
import os
import secrets
import shutil
import time
from collections.abc import Collection, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from map3d.catalogue import SceneRecord, Workspace
from map3d.errors import BadRequest, Corrupt, LimitExceeded, NotFound, ObjectChanged, StoreError
from map3d.object_store import ObjectStore, open_object_store
from map3d.registry import Registry
from map3d.scenes.shared_scene import CONNECTIONS, FILES, INDEX, REGISTRY, SharedFile, SharedScene, files_url, hash_file, object_name, read_shared

LIMIT_VARIABLE: Final = "MAP3D_SCENE_CACHE_GB"
DEFAULT_GB: Final = 64.0
PART_BYTES: Final = 16 << 20
ATTEMPTS: Final = 4
_MARK: Final = ".fetched"


@contextmanager
def scene_in_use(workspace: Workspace, record: SceneRecord) -> Iterator[Path]:
    """Gives the folder of the built scene: the workspace's own, or for a shared scene that another host builds a copy of its files, fetched if it is
    missing or of another build, and kept while the context lasts.

    Raises BadRequest, NotFound, Corrupt, LimitExceeded, StoreError.
    """
    folder = workspace.scene_folder(record.name)
    if FILES not in record.options or has_assets(folder):
        yield folder
        return
    folder.parent.mkdir(parents=True, exist_ok=True)
    with _use_path(folder).open("ab") as use:
        fcntl.flock(use, fcntl.LOCK_SH)
        fetch_scene(workspace, record)
        yield folder


@contextmanager
def open_registry(workspace: Workspace, scene: str) -> Iterator[Registry]:
    """Opens the registry of a scene, of a copy that is fetched if another host builds the scene. Raises the errors of `scene_in_use`."""
    with workspace.open_catalogue() as catalogue:
        record = catalogue.scene(scene)
    with scene_in_use(workspace, record), Registry(workspace.registry_path(scene)) as registry:
        yield registry


def has_assets(folder: Path) -> bool:
    """Whether the scene's files were imported into this workspace, so that it is built here."""
    return (folder / "assets").is_dir()


def fetch_scene(workspace: Workspace, record: SceneRecord) -> None:
    """Brings the copy of a shared scene to the build that the catalogue names. Of several processes, one fetches and the others wait."""
    folder, root = workspace.scene_folder(record.name), workspace.root / ".scene-files"
    root.mkdir(parents=True, exist_ok=True)
    try:
        with (root / ".lock").open("ab") as lock:
            if not _is_current(folder, record):
                fcntl.flock(lock, fcntl.LOCK_EX)
            if not _is_current(folder, record):
                shared = read_shared(record)
                _make_room(root, folder, shared)
                _download_missing(root, record, shared)
                _place(root, folder, shared)
        now = time.time_ns()
        os.utime(folder / _MARK, ns=(now, now))
    except OSError as error:
        raise StoreError(f"{folder}: cannot store the shared scene: {error}") from error


def cache_limit_bytes() -> int:
    """Raises BadRequest unless the environment variable is a positive number."""
    text = os.environ.get(LIMIT_VARIABLE, str(DEFAULT_GB))
    with suppress(ValueError):
        if (limit := float(text)) > 0:
            return int(limit * 1e9)
    raise BadRequest(f"{LIMIT_VARIABLE}={text}: expected a positive number of GB")


def _is_current(folder: Path, record: SceneRecord) -> bool:
    with suppress(FileNotFoundError):
        return record.built is not None and (folder / _MARK).read_text() == record.built
    return False


def _use_path(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.use")


def _cached_path(root: Path, file: SharedFile) -> Path:
    return root / file.hash[:2] / file.hash


def _download_missing(root: Path, record: SceneRecord, shared: SharedScene) -> None:
    url = files_url(record)
    assert url is not None, "read_shared has checked it"
    store = open_object_store(url)
    for path in root.glob("*/.*.new"):
        path.unlink()
    missing = {file for file in shared.files.values() if not _cached_path(root, file).is_file()}
    with ThreadPoolExecutor(CONNECTIONS) as pool:
        list(pool.map(lambda file: _download(store, file, _cached_path(root, file)), sorted(missing)))


def _download(store: ObjectStore, file: SharedFile, path: Path) -> None:
    """Reads a file in parts. A copy with another hash is read again, then raises Corrupt."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{secrets.token_hex(4)}.new")
    try:
        for _ in range(ATTEMPTS):
            with suppress(ObjectChanged):
                _read_parts(store, object_name(file), draft)
                if hash_file(draft) == file.hash:
                    draft.replace(path)
                    return
        raise Corrupt(f"{store.url}/{object_name(file)}: does not match its hash; build the scene again with map3d render on its host")
    finally:
        draft.unlink(missing_ok=True)


def _read_parts(store: ObjectStore, name: str, draft: Path) -> None:
    found = store.get_start(name, PART_BYTES)
    if found is None:
        raise NotFound(f"{store.url}/{name}: missing; the scene was built again meanwhile, or its files were removed: try again")
    data, tag, size = found
    with draft.open("wb") as output:
        output.write(data)
        for start in range(len(data), size if data else 0, PART_BYTES):
            output.write(store.get_range(name, start, min(PART_BYTES, size - start), if_match=tag) or b"")
        output.flush()
        os.fsync(output.fileno())


def _place(root: Path, folder: Path, shared: SharedScene) -> None:
    """Links the files into the scene's folder, the index last, and removes those of an earlier build."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / _MARK).write_text("")
    for name, file in sorted(shared.files.items(), key=lambda item: item[0] == INDEX):
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        draft = target.with_name(f".{target.name}.new")
        draft.unlink(missing_ok=True)
        if name == REGISTRY:
            _cached_path(root, file).replace(draft)
            for suffix in ("-wal", "-shm"):
                (folder / (REGISTRY + suffix)).unlink(missing_ok=True)
        else:
            os.link(_cached_path(root, file), draft)
        draft.replace(target)
        draft.unlink(missing_ok=True)
    for path in [*folder.glob("chunks/*"), *folder.glob("textures/*/*"), *folder.glob("instances.m3i")]:
        if path.relative_to(folder).as_posix() not in shared.files:
            path.unlink()
    draft = folder / f"{_MARK}.new"
    draft.write_text(shared.digest)
    draft.replace(folder / _MARK)


def _make_room(root: Path, folder: Path, shared: SharedScene) -> None:
    """Removes unused files, then the scenes that were used least recently, until the new files fit. Raises LimitExceeded."""
    limit = cache_limit_bytes()
    needed = {file.hash: file.size for file in shared.files.values()}
    if sum(needed.values()) > limit:
        size = sum(needed.values()) / 1e9
        raise LimitExceeded(f"scene {folder.name}: its files have {size:.3g} GB, {LIMIT_VARIABLE} is {limit / 1e9:g}; raise it")
    others = sorted(_fetched_folders(folder), key=lambda other: (other / _MARK).stat().st_mtime_ns)
    while (over := _size_with(root, folder, needed) - limit) > 0:
        if not _remove_unlinked(root, needed, over):
            if not others:
                in_use = f"{over / 1e9:.3g} GB more are needed, and all other scenes in the cache are in use"
                raise LimitExceeded(f"scene {folder.name}: {LIMIT_VARIABLE} is {limit / 1e9:g}; {in_use}; raise it, or stop other work on this node")
            _remove_if_unused(others.pop(0))


def _fetched_folders(but: Path) -> list[Path]:
    return [mark.parent for mark in but.parent.glob(f"*/{_MARK}") if mark.parent != but]


def _size_with(root: Path, folder: Path, needed: dict[str, int]) -> int:
    """Returns the size of the cache once the needed files of the scene in `folder` are in it."""
    paths = [*root.glob("*/*"), *(other / REGISTRY for other in _fetched_folders(folder))]
    return sum(needed.values()) + sum(path.stat().st_size for path in paths if path.name not in needed and path.is_file())


def _remove_unlinked(root: Path, keep: Collection[str], enough: int) -> int:
    """Removes files that no scene has, until `enough` bytes are free; returns the number of bytes."""
    freed = 0
    unlinked = [(stat.st_ctime_ns, path) for path in root.glob("*/*") if (stat := path.stat()).st_nlink == 1 and path.name not in keep]
    for _, path in sorted(unlinked):
        if freed >= enough:
            break
        freed += path.stat().st_size
        path.unlink()
    return freed


def _remove_if_unused(folder: Path) -> None:
    with _use_path(folder).open("ab") as use:
        try:
            fcntl.flock(use, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return
        (folder / _MARK).write_text("")
        (folder / INDEX).unlink(missing_ok=True)
        shutil.rmtree(folder)
