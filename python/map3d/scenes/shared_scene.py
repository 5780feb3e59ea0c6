"""Shares a built scene through an object store (spec/scene.md, Shared scene): the host that builds it uploads its files by hash, with one index per
build; nodes read the index of the build that the catalogue names."""

import hashlib
import json
import os
import re
import sqlite3
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

from map3d.catalogue import SceneRecord, Workspace
from map3d.errors import BadRequest, Corrupt, NotFound, StoreError
from map3d.object_store import ObjectStore, check_store_url, join_url, open_object_store

FILES: Final = "files"
"""Key of the base URL in `SceneRecord.options`."""
REGISTRY: Final = "registry.sqlite"
INDEX: Final = "scene.json"
VERSION: Final = 1
CONNECTIONS: Final = 8
_HASHES: Final = ".shared.json"
_NAMES: Final = re.compile(r"scene\.json|instances\.m3i|registry\.sqlite|chunks/[0-9a-z_-]+\.m3c|textures/[0-9a-f]{2}/[0-9a-z_-]+\.m3t", re.ASCII)
_DIGEST: Final = re.compile(r"[0-9a-f]{64}", re.ASCII)


class SharedFile(NamedTuple):
    """The content of a file of a scene."""

    hash: str
    size: int


@dataclass(frozen=True)
class SharedScene:
    """The files of one build: path in the scene's folder → content. `previous`: the build before."""

    digest: str
    previous: str | None
    files: Mapping[str, SharedFile]

    def dump(self) -> bytes:
        files = {name: list(file) for name, file in sorted(self.files.items())}
        return json.dumps({"version": VERSION, "digest": self.digest, "previous": self.previous, "files": files}, indent=1).encode()

    @classmethod
    def load(cls, data: bytes, where: str) -> "SharedScene":
        """Raises Corrupt for anything else than an index, or a name that does not belong to a built scene."""
        try:
            value = json.loads(data)
            files = {name: SharedFile(str(digest), int(size)) for name, (digest, size) in value["files"].items()}
            if value["version"] != VERSION or INDEX not in files:
                raise ValueError(f"version {value['version']}, {len(files)} files")
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise Corrupt(f"{where}: not the index of a shared scene: {error}") from error
        for name, file in files.items():
            if not (_NAMES.fullmatch(name) and _DIGEST.fullmatch(file.hash) and file.size >= 0):
                raise Corrupt(f"{where}: {name!r} is not a file of a built scene")
        return cls(value["digest"], value["previous"], files)


def check_files_url(url: str) -> str:
    """Returns a base URL for shared scenes that can be stored.

    Raises BadRequest for credentials in it or an unknown scheme, StoreError when the store does not answer.
    """
    checked = check_store_url(url)
    open_object_store(checked).exists(INDEX)
    return checked


def files_url(record: SceneRecord) -> str | None:
    """Returns the URL of a scene's shared files; None if it is not shared."""
    return join_url(record.options[FILES], record.name) if FILES in record.options else None


def read_shared(record: SceneRecord) -> SharedScene:
    """Reads the index of the build that the catalogue names. Raises BadRequest before the first build, NotFound, Corrupt, StoreError."""
    url = files_url(record)
    if url is None or record.built is None:
        raise BadRequest(f"scene {record.name} is not shared, or not built yet; build it with map3d render on the host that has its files")
    found = open_object_store(url).get(_index_name(record.built))
    if found is None:
        raise NotFound(f"{url}: no files of build {record.built} of scene {record.name}; run map3d render on the host that has its files")
    return SharedScene.load(found[0], join_url(url, _index_name(record.built)))


def share_scene(workspace: Workspace, record: SceneRecord, digest: str) -> int:
    """Uploads the files of build `digest` that the object store lacks, then the index, and deletes files of builds before the previous one.

    The caller holds the scene's lock. Returns the number of uploaded files. Raises StoreError.
    """
    url = files_url(record)
    assert url is not None, "the caller checks that the scene is shared"
    store, folder = open_object_store(url), workspace.scene_folder(record.name)
    try:
        with TemporaryDirectory(prefix=".sharing-", dir=folder) as draft:
            paths = {name: folder / name for name in _built_files(folder)} | {REGISTRY: _snapshot(folder / REGISTRY, Path(draft) / REGISTRY)}
            files = _hash_files(folder, paths)
            stored = {name for name, _ in store.list("files")}
            missing = {object_name(file): paths[name] for name, file in files.items() if object_name(file) not in stored}
            with ThreadPoolExecutor(CONNECTIONS) as pool:
                list(pool.map(lambda item: store.put(*item), missing.items()))
    except (OSError, sqlite3.Error) as error:
        raise StoreError(f"{folder}: cannot read the built scene: {error}") from error
    store.put(_index_name(digest), SharedScene(digest, record.built if record.built != digest else None, files).dump())
    _delete_old_builds(store, {digest, record.built}, stored)
    return len(missing)


def remove_shared(url: str) -> None:
    """Deletes all shared files of a scene, indexes first. `url`: of `files_url`."""
    store = open_object_store(url)
    with ThreadPoolExecutor(CONNECTIONS) as pool:
        for folder in ("builds", "files"):
            list(pool.map(store.delete, [name for name, _ in store.list(folder)]))


def object_name(file: SharedFile) -> str:
    return f"files/{file.hash[:2]}/{file.hash}"


def hash_file(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=32)).hexdigest()


def _index_name(digest: str) -> str:
    return f"builds/{digest}.json"


def _built_files(folder: Path) -> Iterator[str]:
    """Yields the files that rendering reads."""
    index: dict[str, Any] = json.loads((folder / INDEX).read_text(encoding="utf-8"))
    yield INDEX
    yield from {entry["file"] for entry in [*index["chunks"], *index["prototypes"]]}
    if (folder / index["instances"]["file"]).is_file():
        yield index["instances"]["file"]
    yield from (path.relative_to(folder).as_posix() for path in folder.glob("textures/*/*.m3t"))


def _snapshot(source: Path, target: Path) -> Path:
    """Copies the registry consistently; equal content gives equal bytes."""
    database = sqlite3.connect(source)
    try:
        database.execute("VACUUM INTO ?", (str(target),))
    finally:
        database.close()
    return target


def _hash_files(folder: Path, paths: Mapping[str, Path]) -> dict[str, SharedFile]:
    """Returns the content of each file. Files that did not change since the last time are not read."""
    try:
        known: dict[str, list[Any]] = json.loads((folder / _HASHES).read_text())
    except (OSError, ValueError):
        known = {}
    found: dict[str, SharedFile] = {}
    for name, path in paths.items():
        stat = path.stat()
        state = [stat.st_ino, stat.st_mtime_ns, stat.st_size]
        digest = known[name][0] if name in known and known[name][1] == state else hash_file(path)
        known[name], found[name] = [digest, state], SharedFile(digest, stat.st_size)
    draft = folder / f"{_HASHES}.new"
    draft.write_text(json.dumps({name: known[name] for name in paths}))
    os.replace(draft, folder / _HASHES)
    return found


def _delete_old_builds(store: ObjectStore, kept: set[str | None], stored: set[str]) -> None:
    """Deletes the indexes of other builds, and those of the `stored` files that no kept build names."""
    used: set[str] = set()
    for name, _ in list(store.list("builds")):
        if name not in {_index_name(digest) for digest in kept if digest}:
            store.delete(name)
        elif (found := store.get(name)) is not None:
            used |= {object_name(file) for file in SharedScene.load(found[0], name).files.values()}
    with ThreadPoolExecutor(CONNECTIONS) as pool:
        list(pool.map(store.delete, sorted(stored - used)))
