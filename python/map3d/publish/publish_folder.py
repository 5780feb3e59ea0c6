"""Publishes a rendering (spec/manifest.md): manifest, archives, attribute shards and viewer in one folder for any static host with range requests.

The draft has a hidden name beside the final folder and is renamed once complete. After a stop, the next attempt reuses the finished archives.
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
from map3d.registry import Registry
from map3d.renderings.track_stores import open_track, read_manifest, rendering_record
from map3d.tiles.manifest import FILE_NAME, Manifest, ManifestView
from map3d.tiles.tile_store import TileStore
from map3d.tiles.viewer_files import viewer_files, viewer_folder
from map3d.types import Layer

OnTiles = Callable[[str, int, int], bool]
"""(stage, done, total) → False to stop."""

CHECKSUMS: Final = "checksums.sha256"
README: Final = "README.txt"
ICON: Final = "favicon.ico"
_ICON_PATH: Final = Path(__file__).parents[1] / "web" / "static" / ICON
ARCHIVE_VERSION: Final = 2
"""Incremented when archives of the same tiles change, so that archives of older drafts are not reused."""

_README_TEXT: Final = """{title}
{attribution}
This folder is a self-contained map of oblique views, rendered with map3d. Copy it to any web host and open index.html there.

The host must
- serve range requests (HTTP "Range"). nginx, Apache, Caddy and S3-compatible hosts do; `python -m http.server` does not, so the map stays empty.
  To view the map on your own machine: `caddy file-server --listen :8000`, or nginx with `root` set to this folder.
- send *.pmtiles uncompressed: they contain compressed images.
To use the tiles from pages on other hosts, send `Access-Control-Allow-Origin: *` and allow the request header `Range`.

rendering.json           views, layers, levels, coordinate system
<view>/<layer>.pmtiles   tiles of one view and layer
objects/                 attributes of the objects, and the search index
index.html, *.js         the viewer
checksums.sha256         to check a copy, run: sha256sum -c checksums.sha256
"""


@dataclass(frozen=True)
class Published:
    """Counts of a published folder. `kept`: archives reused from a stopped attempt."""

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
    progress: OnTiles | None = None,
) -> Published:
    """Writes the folder `out`. With `replace`, the last step replaces an existing published folder.

    Raises NotFound, AlreadyExists, BadRequest (incomplete), Corrupt (tiles changed meanwhile), Stopped, StoreError; ViewerMissing before any work.
    """
    out = out.absolute()
    viewer_folder()
    manifest = _read_manifest(workspace, rendering, allow_incomplete)
    _check_target(out, replace)
    draft = out.with_name(f".{out.name}.publishing")
    try:
        draft.mkdir(parents=True, exist_ok=True)
        writer = _FolderWriter(workspace, manifest, draft, progress or (lambda *_: True))
        writer.write()
        _replace_folder(draft, out)
    except OSError as error:
        raise StoreError(f"{draft}: cannot write the folder: {error}") from error
    return Published(out, writer.tiles, writer.archives, writer.kept, sum(path.stat().st_size for path in out.rglob("*") if path.is_file()))


class _FolderWriter:
    """Writes the draft folder."""

    def __init__(self, workspace: Workspace, manifest: Manifest, draft: Path, progress: OnTiles) -> None:
        self._workspace, self._manifest, self._draft, self._progress = workspace, manifest, draft, progress
        self._record = rendering_record(workspace, manifest.name)
        self.tiles = self.archives = self.kept = self._done = 0
        self._total = sum(view.occupancy.count() for view in manifest.views) * len(manifest.layers)
        self._files: dict[str, str] = {}
        self._content: list[str] = []

    def write(self) -> None:
        archives = {view.frame.id: self._write_view(view) for view in self._manifest.views}
        with Registry(self._workspace.registry_path(self._record.scene)) as registry:
            for name, data in registry.documents():
                self._write_file(name, data)
        self._write_file(ICON, _ICON_PATH.read_bytes())
        for file in viewer_files():
            self._write_file(file.as_posix(), (viewer_folder() / file).read_bytes())
        self._write_file(README, _readme(self._manifest).encode())
        self._write_file(FILE_NAME, self._manifest.with_archives(archives, self._content_version()).dump())
        lines = [f"{digest}  {name}\n" for name, digest in sorted(self._files.items())]
        self._write_file(CHECKSUMS, "".join(lines).encode())
        self._remove_leftovers()

    def _write_view(self, view: ManifestView) -> dict[str, str]:
        """Returns the archive path of each layer."""
        paths = {}
        for number, layers in enumerate(self._manifest.passes):
            with open_track(self._workspace, self._record, track_id(view.frame.id, number)) as store:
                for layer in layers:
                    name = f"{view.frame.id}/{layer.name}.pmtiles"
                    if self._write_archive(store, layer, view.frame.id, self._draft / name):
                        paths[layer.name] = name
                        self._files[name] = _file_digest(self._draft / name)
                        self.archives += 1
        return paths

    def _write_archive(self, store: TileStore, layer: Layer, view: str, path: Path) -> int:
        metadata = self._metadata(store, layer, view)
        number = store.shape.layer_number(layer.name)
        tiles = _count_finished_tiles(path, metadata)
        if tiles:
            self.kept += 1
            self._advance(tiles)
        else:
            tiles = write_archive(store, number, path, metadata, self._advance)
        if self._metadata(store, layer, view) != metadata:
            path.unlink(missing_ok=True)
            raise Corrupt(
                f"rendering {self._manifest.name}, view {view}: tiles changed during publishing; wait until no render runs, then publish again"
            )
        self.tiles += tiles
        self._content.append(metadata["map3d"]["content"])
        return tiles

    def _content_version(self) -> int:
        """Returns a number that depends on the tiles alone, not on how often and in which order they were rendered."""
        return 1 + int(sha256(json.dumps(self._content).encode()).hexdigest()[:11], 16)

    def _metadata(self, store: TileStore, layer: Layer, view: str) -> dict[str, Any]:
        """Returns the archive's metadata; `content` is the digest of everything that its bytes depend on."""
        tiles = store.layer_digest(store.shape.layer_number(layer.name))
        content = sha256(json.dumps([ARCHIVE_VERSION, layer.name, layer.format, tiles]).encode()).hexdigest()
        facts = {"rendering": self._manifest.name, "view": view, "layer": layer.name, "content": content}
        title = self._manifest.title or self._manifest.name
        description = "Oblique image tiles in the view's own plane, not on the globe: see rendering.json."
        return {"name": f"{title}: {layer.name}", "attribution": self._manifest.attribution, "description": description, "map3d": facts}

    def _advance(self, tiles: int) -> None:
        self._done += tiles
        if not self._progress("publish", self._done, max(self._total, self._done)):
            raise Stopped(f"publishing stopped after {self._done:,} tiles; publish again to resume")

    def _write_file(self, name: str, data: bytes) -> None:
        path = self._draft / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        self._files[name] = sha256(data).hexdigest()

    def _remove_leftovers(self) -> None:
        """Removes the files of earlier attempts that this one did not write."""
        for path in sorted(self._draft.rglob("*"), reverse=True):
            if path.is_file() and path.relative_to(self._draft).as_posix() not in self._files:
                path.unlink()
            elif path.is_dir() and not any(path.iterdir()):
                path.rmdir()


def _read_manifest(workspace: Workspace, rendering: str, allow_incomplete: bool) -> Manifest:
    data = read_manifest(workspace, rendering_record(workspace, rendering))
    if data is None:
        raise NotFound(f"rendering {rendering!r} has no tiles yet; run: map3d render {rendering}")
    manifest = Manifest.load(data, str(workspace.manifest_path(rendering)))
    if not manifest.complete and not allow_incomplete:
        raise BadRequest(f"rendering {rendering!r} is incomplete; render it first (map3d render {rendering}), or give --allow-incomplete")
    return manifest


def _check_target(out: Path, replace: bool) -> None:
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    if not out.is_dir() or not (out / FILE_NAME).is_file():
        raise AlreadyExists(f"{out}: exists and is not a published rendering; name another folder")
    if not replace:
        raise AlreadyExists(f"{out}: already contains a published rendering; replace it with --replace, or name another folder")


def _count_finished_tiles(path: Path, metadata: dict[str, Any]) -> int:
    """Returns the number of tiles in a finished archive of the same content; 0 without one."""
    if not path.is_file():
        return 0
    try:
        archive = Archive(path)
        return sum(1 for _ in archive.tiles()) if archive.metadata == metadata else 0
    except Corrupt:
        return 0


def _file_digest(path: Path) -> str:
    digest = sha256()
    with path.open("rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()


def _replace_folder(draft: Path, out: Path) -> None:
    old = out.with_name(f".{out.name}.old")
    shutil.rmtree(old, ignore_errors=True)
    if out.exists():
        out.rename(old)
    draft.rename(out)
    shutil.rmtree(old, ignore_errors=True)


def _readme(manifest: Manifest) -> str:
    attribution = f"{manifest.attribution}\n" if manifest.attribution else ""
    return _README_TEXT.format(title=manifest.title or manifest.name, attribution=attribution)
