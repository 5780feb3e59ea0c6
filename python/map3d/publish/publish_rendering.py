"""Publishes a rendering (spec/manifest.md): manifest, archives, objects, preview and viewer, for any static host with range requests.

The target is a folder or an object store. What it already has is not written again, and it switches to the new state once everything is there.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from hashlib import sha256
from itertools import chain, islice
from pathlib import Path
from typing import Any, Final

from map3d.catalogue import RenderingRecord, Workspace
from map3d.errors import BadRequest, Corrupt, NotFound, Stopped, StoreError
from map3d.geometry.views import track_id
from map3d.object_store import open_object_store
from map3d.publish.folder_target import FolderTarget
from map3d.publish.layer_definitions import gdal_wms, qgis_layer, wkt
from map3d.publish.page_head import add_policy, describe_page
from map3d.publish.pmtiles_archive import write_archive
from map3d.publish.preview_picture import FILE as PREVIEW
from map3d.publish.preview_picture import make_preview
from map3d.publish.report_page import report_files
from map3d.publish.size_report import SizeRow, report_sizes
from map3d.publish.store_target import StoreTarget
from map3d.publish.target import LAST, DryRun, MapIdentity, Target
from map3d.scenes.scene_cache import open_registry
from map3d.site.report import read_report
from map3d.tiles.manifest import FILE_NAME, Manifest, ManifestView
from map3d.tiles.tile_store import TileStore
from map3d.tiles.track_stores import open_track, read_manifest, rendering_record
from map3d.tiles.viewer_files import PAGE, viewer_files, viewer_folder
from map3d.types import COLOR_KINDS, FILE_SUFFIXES, Layer, TileId

OnTiles = Callable[[str, int, int], bool]
"""(stage, done, total) → False to stop. The stage "publish" counts tiles, "files" counts other files; `total` is 0 if it is unknown."""

GIS: Final = "gis"
"""Folder of the files for GIS software."""
README: Final = "README.txt"
IIS_SETTINGS: Final = "web.config"
ICON: Final = "favicon.ico"
_ICON_PATH: Final = Path(__file__).parents[1] / "web" / "static" / ICON
ARCHIVE_VERSION: Final = 2
"""Incremented when archives of the same tiles change, so that earlier archives are not reused."""
SAMPLED_TILES: Final = 256
"""Tiles from which a dry run estimates the size of an archive."""
FILES_PER_STEP: Final = 100

_IIS: Final = b"""<?xml version="1.0" encoding="UTF-8"?>
<configuration>
  <system.webServer>
    <staticContent>
      <remove fileExtension=".pmtiles" />
      <mimeMap fileExtension=".pmtiles" mimeType="application/vnd.pmtiles" />
    </staticContent>
  </system.webServer>
</configuration>
"""
"""IIS sends no file whose extension it does not know. Other web servers ignore this file."""

_README_TEXT: Final = """{title}
{attribution}
This folder is a self-contained map of oblique views, rendered with map3d. Copy it to any web host and open index.html there.

The host must
- serve range requests (HTTP "Range"). nginx, Apache, Caddy, lighttpd, IIS and S3-compatible hosts do; `python -m http.server` does not, and the map
  says so.
  To view the map on your own machine: `caddy file-server --listen :8000`, or nginx with `root` set to this folder.
- send *.pmtiles uncompressed: they contain compressed images.
To use the tiles from pages on other hosts, send `Access-Control-Allow-Origin: *` and allow the request header `Range`.

To show the picture in messengers and social networks, publish with `--url ADDRESS`, or write the map's address before preview.jpg in index.html: most
networks do not understand relative addresses.

rendering.json               views, layers, levels, coordinate system
<view>/<layer>-….pmtiles     tiles of one view and layer; the name follows from the content
objects/                     attributes of the objects, and the search index
preview.jpg                  picture for links to the map
index.html, *.js             the viewer
web.config                   lets IIS send *.pmtiles; other web servers ignore it
report.html                  what the files held from which `map3d site` made the map; absent otherwise
checksums.sha256             to check a copy, run: sha256sum -c checksums.sha256
"""


@dataclass(frozen=True)
class Published:
    """What was published, or would be in a dry run. `target`: folder or URL; `kept`: archives that the target or a stopped attempt already had;
    `written`: files that were written or sent; `removed`: files that no longer belong."""

    target: str
    dry_run: bool
    tiles: int
    archives: int
    kept: int
    files: int
    bytes: int
    written: int
    written_bytes: int
    removed: int
    sizes: tuple[SizeRow, ...]


def publish(
    workspace: Workspace,
    rendering: str,
    out: Path | str,
    *,
    replace: bool = False,
    allow_incomplete: bool = False,
    dry_run: bool = False,
    url: str | None = None,
    gis: bool = False,
    max_file_bytes: int | None = None,
    progress: OnTiles | None = None,
) -> Published:
    """Publishes to a folder, or to an object store when `out` is a URL such as s3://BUCKET/PREFIX.

    A publication of the same rendering is updated. `replace`: replaces that of another one; `dry_run`: writes nothing; `url`: address at which
    people will open the map, for the picture of links;
    `gis`: also writes colour tiles as files, with layer definitions for QGIS and GDAL, which read no archives. The definitions name the tiles by
    `url`, else by the path of the folder. `max_file_bytes`: divides archives into files of this size, for hosts with a limit.

    Raises NotFound, AlreadyExists, BadRequest (incomplete, a file that is not divided is larger than `max_file_bytes`, or `gis` to an object store
    without `url`), Corrupt (tiles changed meanwhile), Stopped, StoreError; ViewerMissing before any work.
    """
    viewer_folder()
    record = rendering_record(workspace, rendering)
    manifest = _read_manifest(workspace, record, allow_incomplete)
    target = _open_target(workspace, rendering, out)
    target = DryRun(target) if dry_run else target
    tiles_at = _gis_address(out, url) if gis else None
    publisher = _Publisher(workspace, record, manifest, target, progress or (lambda *_: True))
    try:
        target.start(MapIdentity(manifest.name, manifest.origin), replace)
        target.part_bytes = max_file_bytes or 0
        publisher.write(url, tiles_at)
        target.finish()
    except OSError as error:
        raise StoreError(f"{target.url}: cannot write: {error}") from error
    finally:
        target.close()
    return Published(
        target=target.url,
        dry_run=dry_run,
        tiles=publisher.tiles,
        archives=publisher.archives,
        kept=target.kept_archives,
        files=len(target.sizes),
        bytes=sum(target.sizes.values()),
        written=len(target.changed),
        written_bytes=sum(target.changed.values()),
        removed=len(target.removed),
        sizes=report_sizes(target.sizes),
    )


def _gis_address(out: Path | str, url: str | None) -> str:
    """Returns the address of the published folder, without a slash at its end."""
    if url is not None:
        return url.rstrip("/")
    if not isinstance(out, Path) and "://" in out:
        raise BadRequest(f"{out}: layer definitions for GIS software need the address of the tiles; give --url ADDRESS")
    return Path(out).absolute().as_uri()


def _open_target(workspace: Workspace, rendering: str, out: Path | str) -> Target:
    if isinstance(out, Path) or "://" not in out:
        return FolderTarget(Path(out))
    staging = workspace.rendering_folder(rendering) / f"publishing-{sha256(out.encode()).hexdigest()[:16]}"
    return StoreTarget(open_object_store(out), staging)


class _Publisher:
    """Gives all files of the rendering to the target."""

    def __init__(self, workspace: Workspace, record: RenderingRecord, manifest: Manifest, target: Target, progress: OnTiles) -> None:
        self._workspace, self._record, self._manifest, self._target, self._progress = workspace, record, manifest, target, progress
        self.tiles = self.archives = self._done = 0
        self._total = sum(view.occupancy.count() for view in manifest.views) * len(manifest.layers)
        self._content: list[str] = []

    def write(self, url: str | None, tiles_at: str | None) -> None:
        """Files that refer to others come last. `tiles_at`: address of the folder, if it shall have files for GIS software."""
        archives = {view.frame.id: self._write_view(view) for view in self._manifest.views}
        manifest = self._manifest.with_archives(archives, self._content_version(), self._target.part_bytes)
        last: dict[str, bytes] = {FILE_NAME: manifest.dump()}
        files = chain(self._files(url), () if tiles_at is None else self._gis_files(tiles_at))
        for count, (name, data) in enumerate(files, 1):
            _check_size(name, len(data), self._target.part_bytes)
            if name in LAST:
                last[name] = data
            else:
                self._target.add(name, data)
            if count % FILES_PER_STEP == 0 and not self._progress("files", count, 0):
                raise Stopped(f"publishing stopped after {count:,} files; publish again to resume")
        for name in LAST:
            if name in last:
                self._target.add(name, last[name])

    def _files(self, url: str | None) -> Iterator[tuple[str, bytes]]:
        """Yields all files apart from archives and manifest."""
        with open_registry(self._workspace, self._record.scene) as registry:
            yield from registry.documents()
        picture = make_preview(self._workspace, self._record, self._manifest)
        if picture is not None:
            yield PREVIEW, picture
        yield ICON, _ICON_PATH.read_bytes()
        report = read_report(self._workspace, self._record.name)
        if report is not None:
            size = sum(size for name, size in self._target.sizes.items() if name.endswith(".pmtiles"))
            yield from report_files(report, self.tiles, size, None if picture is None else PREVIEW)
        for file in viewer_files():
            data = (viewer_folder() / file).read_bytes()
            yield file.as_posix(), self._describe(data, picture is not None, url) if file.as_posix() == PAGE else data
        yield README, _readme(self._manifest).encode()
        yield IIS_SETTINGS, _IIS

    def _gis_files(self, address: str) -> Iterator[tuple[str, bytes]]:
        """Yields the tiles of the colour layers as files, and layer definitions that name them."""
        for view in self._manifest.views:
            yield f"{GIS}/{view.frame.id}.wkt", wkt(self._manifest, view).encode()
            for number, layers in enumerate(self._manifest.passes):
                for layer in (layer for layer in layers if layer.kind in COLOR_KINDS):
                    place, suffix = f"{GIS}/{view.frame.id}/{layer.name}", FILE_SUFFIXES[layer.format]
                    template = f"{address}/{place}/{{z}}/{{x}}/{{y}}.{suffix}"
                    yield f"{GIS}/{view.frame.id}-{layer.name}.xml", gdal_wms(self._manifest, view, layer, template).encode()
                    yield f"{GIS}/{view.frame.id}-{layer.name}.qlr", qgis_layer(self._manifest, view, layer, template).encode()
                    with open_track(self._workspace, self._record, track_id(view.frame.id, number)) as store:
                        stored = store.shape.layer_number(layer.name)
                        for tile in store.list_tiles(stored):
                            yield f"{place}/{tile.z}/{tile.x}/{tile.y}.{suffix}", store.get_tile(stored, *tile) or b""

    def _describe(self, page: bytes, has_picture: bool, url: str | None) -> bytes:
        base = "" if url is None else url.rstrip("/") + "/"
        return describe_page(add_policy(page.decode()), self._manifest, base + PREVIEW if has_picture else None, base or None).encode()

    def _write_view(self, view: ManifestView) -> dict[str, str]:
        """Returns the archive path of each layer."""
        paths = {}
        for number, layers in enumerate(self._manifest.passes):
            with open_track(self._workspace, self._record, track_id(view.frame.id, number)) as store:
                for layer in layers:
                    name = self._write_archive(store, layer, view)
                    if name is not None:
                        paths[layer.name] = name
                        self.archives += 1
        return paths

    def _write_archive(self, store: TileStore, layer: Layer, view: ManifestView) -> str | None:
        """Returns the archive's path; None for a layer without tiles."""
        metadata = self._metadata(store, layer, view.frame.id)
        part_bytes = self._target.part_bytes
        name = f"{view.frame.id}/{layer.name}-{_digest([metadata, part_bytes] if part_bytes else metadata)[:16]}.pmtiles"
        found = self._target.find_archive(name, metadata)
        if found is not None:
            tiles = view.occupancy.count() if found.tiles is None else found.tiles
            self._advance(tiles)
        elif isinstance(self._target, DryRun):
            tiles = self._estimate_archive(self._target, store, layer, name)
        else:
            tiles = write_archive(store, store.shape.layer_number(layer.name), self._target.archive_path(name), metadata, self._advance)
        self._check_unchanged(store, layer, view.frame.id, metadata, name)
        if found is None and tiles and not self._target.dry:
            self._target.add_archive(name)
        self.tiles += tiles
        self._content.append(metadata["map3d"]["content"])
        return name if tiles else None

    def _estimate_archive(self, target: DryRun, store: TileStore, layer: Layer, name: str) -> int:
        number = store.shape.layer_number(layer.name)
        tiles: list[TileId] = list(store.list_tiles(number))
        if tiles:
            sample = list(islice(tiles, 0, None, max(len(tiles) // SAMPLED_TILES, 1)))
            target.estimate_archive(name, sum(len(store.get_tile(number, *tile) or b"") for tile in sample) * len(tiles) // len(sample))
        return len(tiles)

    def _check_unchanged(self, store: TileStore, layer: Layer, view: str, metadata: dict[str, Any], name: str) -> None:
        if self._metadata(store, layer, view) == metadata:
            return
        if not self._target.dry:
            self._target.archive_path(name).unlink(missing_ok=True)
        raise Corrupt(f"rendering {self._manifest.name}, view {view}: tiles changed during publishing; wait until no render runs, then publish again")

    def _content_version(self) -> int:
        """Returns a number that depends on the tiles alone, not on how often and in which order they were rendered."""
        return 1 + int(_digest(self._content)[:11], 16)

    def _metadata(self, store: TileStore, layer: Layer, view: str) -> dict[str, Any]:
        """Returns the archive's metadata; `content` is the digest of everything that its bytes depend on."""
        tiles = store.layer_digest(store.shape.layer_number(layer.name))
        content = _digest([ARCHIVE_VERSION, layer.name, layer.format, tiles])
        facts = {"rendering": self._manifest.name, "view": view, "layer": layer.name, "content": content}
        title = self._manifest.title or self._manifest.name
        description = "Oblique image tiles in the view's own plane, not on the globe: see rendering.json."
        return {"name": f"{title}: {layer.name}", "attribution": self._manifest.attribution, "description": description, "map3d": facts}

    def _advance(self, tiles: int) -> None:
        self._done += tiles
        if not self._progress("tiles", self._done, max(self._total, self._done)):
            raise Stopped(f"publishing stopped after {self._done:,} tiles; publish again to resume")


def _check_size(name: str, size: int, limit: int) -> None:
    """Raises BadRequest for a file that is not divided and exceeds the limit; 0: none."""
    if 0 < limit < size:
        raise BadRequest(f"{name} has {size:,} bytes, more than --max-file allows ({limit:,}), and is not divided; allow larger files")


def _digest(value: Any) -> str:
    return sha256(json.dumps(value).encode()).hexdigest()


def _read_manifest(workspace: Workspace, record: RenderingRecord, allow_incomplete: bool) -> Manifest:
    rendering = record.name
    data = read_manifest(workspace, record)
    if data is None:
        raise NotFound(f"rendering {rendering!r} has no tiles yet; run: map3d render {rendering}")
    manifest = Manifest.load(data, str(workspace.manifest_path(rendering)))
    if not manifest.complete and not allow_incomplete:
        raise BadRequest(f"rendering {rendering!r} is incomplete; render it first (map3d render {rendering}), or give --allow-incomplete")
    return manifest


def _readme(manifest: Manifest) -> str:
    attribution = f"{manifest.attribution}\n" if manifest.attribution else ""
    return _README_TEXT.format(title=manifest.title or manifest.name, attribution=attribution)
