"""Publishing (spec/manifest.md): manifest, archives, attribute shards and viewer in one folder that any static host with range requests can serve.

The folder grows under a hidden name beside its place and is renamed when whole. What was finished before a stop is kept and used again.
"""

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

from map3d.catalogue import Workspace
from map3d.errors import AlreadyExists, BadRequest, Corrupt, NotFound, Stopped, StoreError
from map3d.geometry.views import track_id
from map3d.publish.pmtiles_archive import Archive, write_archive
from map3d.publish.readme import README, readme
from map3d.registry import Registry
from map3d.tiles.manifest import ATTRIBUTES, COLUMNS, FILE_NAME, SEARCH, SHARDS, Manifest, ViewFacts, dump_document
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.store import TileStore
from map3d.tiles.viewer_files import viewer_files, viewer_folder
from map3d.types import Layer

Progress = Callable[[str, int, int], bool]
"""(stage, done, total) → False to stop."""

CHECKSUMS: Final = "checksums.sha256"
ARCHIVE_VERSION: Final = 1
"""Raised when archives of the same tiles change, so that unfinished folders of before are not taken up."""


@dataclass(frozen=True)
class Published:
    """What was published. `kept`: archives that an earlier, stopped attempt had finished."""

    folder: Path
    tiles: int
    archives: int
    kept: int
    bytes: int


def publish(
    workspace: Workspace,
    rendering: str,
    out: Path,
    *,
    replace: bool = False,
    allow_incomplete: bool = False,
    progress: Progress | None = None,
) -> Published:
    """Writes the folder `out`. `replace`: an earlier one of that name gives way, at the very end.

    Raises NotFound, AlreadyExists, BadRequest (not complete), Corrupt (changed meanwhile), Stopped, StoreError, and ViewerMissing before any work.
    """
    out = out.absolute()
    viewer_folder()
    manifest = _manifest(workspace, rendering, allow_incomplete)
    _check_place(out, replace)
    draft = out.with_name(f".{out.name}.publishing")
    try:
        draft.mkdir(parents=True, exist_ok=True)
        work = _Work(workspace, manifest, draft, progress or (lambda *_: True))
        done = work.write()
        _put_in_place(draft, out)
    except OSError as error:
        raise StoreError(f"{draft}: cannot write: {error}") from error
    return Published(out, done.tiles, done.archives, done.kept, sum(path.stat().st_size for path in out.rglob("*") if path.is_file()))


class _Work:
    """The folder under its hidden name."""

    def __init__(self, workspace: Workspace, manifest: Manifest, draft: Path, progress: Progress) -> None:
        self._workspace, self._manifest, self._draft, self._progress = workspace, manifest, draft, progress
        self.tiles = self.archives = self.kept = self._done = 0
        self._total = sum(view.occupancy.count() for view in manifest.views) * len(manifest.layers)
        self._files: dict[str, str] = {}

    def write(self) -> "_Work":
        archives = {view.frame.id: self._write_view(view) for view in self._manifest.views}
        scene = self._scene()
        with Registry(self._workspace.registry_path(scene)) as registry:
            for shard in registry.shards():
                self._put(SHARDS.format(shard=shard["shard"]), dump_document(shard))
            self._put(SEARCH, dump_document(registry.search()))
            self._put(ATTRIBUTES, dump_document(registry.attribute_index()))
            for key, column in registry.columns():
                self._put(COLUMNS.format(column=key), dump_document(column))
        for file in viewer_files():
            self._put(file.as_posix(), (viewer_folder() / file).read_bytes())
        self._put(README, readme(self._manifest).encode())
        self._put(FILE_NAME, self._manifest.with_archives(archives).dump())
        lines = [f"{digest}  {name}\n" for name, digest in sorted(self._files.items())]
        self._put(CHECKSUMS, "".join(lines).encode())
        self._remove_others()
        return self

    def _write_view(self, view: ViewFacts) -> dict[str, str]:
        """Layer → path of its archive."""
        paths = {}
        for number, layers in enumerate(self._manifest.passes):
            track = self._workspace.store_path(self._manifest.name, track_id(view.frame.id, number))
            with SqliteTileStore(track, read_only=True) as store:
                for layer in layers:
                    name = f"{view.frame.id}/{layer.name}.pmtiles"
                    if self._write_archive(store, layer, view.frame.id, self._draft / name):
                        paths[layer.name] = name
                        self._files[name] = _digest(self._draft / name)
                        self.archives += 1
        return paths

    def _write_archive(self, store: TileStore, layer: Layer, view: str, path: Path) -> int:
        metadata = self._metadata(store, layer, view)
        number = store.shape.number_of(layer.name)
        tiles = _tiles_of_finished(path, metadata)
        if tiles:
            self.kept += 1
            self._step(tiles)
        else:
            tiles = write_archive(store, number, path, metadata, self._step)
        if self._metadata(store, layer, view) != metadata:
            path.unlink(missing_ok=True)
            raise Corrupt(f"rendering {self._manifest.name}, view {view}: tiles changed meanwhile; publish again when nothing renders")
        self.tiles += tiles
        return tiles

    def _metadata(self, store: TileStore, layer: Layer, view: str) -> dict[str, Any]:
        """`content` tells archives of other tiles apart."""
        blocks = [(str(block.id), block.key, block.version, block.tiles) for block in store.list_blocks()]
        content = sha256(json.dumps([ARCHIVE_VERSION, layer.name, layer.format, blocks]).encode()).hexdigest()
        facts = {"rendering": self._manifest.name, "view": view, "layer": layer.name, "content": content}
        title = self._manifest.title or self._manifest.name
        description = "Oblique image tiles in the view's own plane, not on the globe: see rendering.json."
        return {"name": f"{title}: {layer.name}", "attribution": self._manifest.attribution, "description": description, "map3d": facts}

    def _step(self, tiles: int) -> None:
        self._done += tiles
        if not self._progress("publish", self._done, max(self._total, self._done)):
            raise Stopped(f"publishing stopped after {self._done:,} tiles; publish again to go on where it stopped")

    def _put(self, name: str, data: bytes) -> None:
        path = self._draft / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        self._files[name] = sha256(data).hexdigest()

    def _remove_others(self) -> None:
        """What an earlier attempt left and this one does not have."""
        for path in sorted(self._draft.rglob("*"), reverse=True):
            if path.is_file() and path.relative_to(self._draft).as_posix() not in self._files:
                path.unlink()
            elif path.is_dir() and not any(path.iterdir()):
                path.rmdir()

    def _scene(self) -> str:
        catalogue = self._workspace.open_catalogue()
        try:
            return catalogue.rendering(self._manifest.name).scene
        finally:
            catalogue.close()


def _manifest(workspace: Workspace, rendering: str, allow_incomplete: bool) -> Manifest:
    path = workspace.manifest_path(rendering)
    try:
        manifest = Manifest.load(path.read_bytes(), str(path))
    except FileNotFoundError as error:
        raise NotFound(f"rendering {rendering!r} is not there, or nothing of it is rendered yet: map3d render {rendering}") from error
    if not manifest.complete and not allow_incomplete:
        raise BadRequest(f"rendering {rendering!r} is not complete; render it first (map3d render {rendering}), or give --allow-incomplete")
    return manifest


def _check_place(out: Path, replace: bool) -> None:
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    if not out.is_dir() or not (out / FILE_NAME).is_file():
        raise AlreadyExists(f"{out}: is there already and is no published rendering; name another folder")
    if not replace:
        raise AlreadyExists(f"{out}: is published already; replace it with --replace, or name another folder")


def _tiles_of_finished(path: Path, metadata: dict[str, Any]) -> int:
    """How many tiles a finished archive of the same content has; 0 when there is none."""
    if not path.is_file():
        return 0
    try:
        archive = Archive(path)
        return sum(1 for _ in archive.tiles()) if archive.metadata == metadata else 0
    except Corrupt:
        return 0


def _digest(path: Path) -> str:
    digest = sha256()
    with path.open("rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()


def _put_in_place(draft: Path, out: Path) -> None:
    old = out.with_name(f".{out.name}.old")
    shutil.rmtree(old, ignore_errors=True)
    if out.exists():
        out.rename(old)
    draft.rename(out)
    shutil.rmtree(old, ignore_errors=True)
