"""Exports one view and layer for other software: MBTiles, a folder of z/x/y files, or a Deep Zoom Image. Tiles keep their bytes; normal, id and depth
of data tiles become PNG.

Every target appears only once it is complete. A stopped export of files resumes where it stopped, unless the tiles have changed.
"""

import io
import json
import os
import shutil
import sqlite3
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from PIL import Image

from map3d.catalogue import Workspace
from map3d.errors import AlreadyExists, BadRequest, Corrupt, NotFound, Stopped, StoreError
from map3d.geometry.views import track_id
from map3d.requests.publications import ExportFormat
from map3d.tiles.decode_tile import as_layer, decode_channels, find_layer, layer_names
from map3d.tiles.manifest import Manifest, ManifestView
from map3d.tiles.tile_store import TileStore
from map3d.tiles.track_stores import open_track, read_manifest, rendering_record
from map3d.types import COLOR_KINDS, DATA_TILE_KINDS, FILE_SUFFIXES, Layer, TileId

TILES_PER_STEP: Final = 256
_NAMESPACE: Final = "http://schemas.microsoft.com/deepzoom/2008"
_MBTILES_FORMATS: Final = ("webp", "png", "jpeg")
"""Formats that MBTiles 1.3 names by suffix, others by media type."""
MARKER: Final = ".map3d-export.json"
NOTE: Final = "Oblique image tiles in the view's own plane, not on the globe: positions have no longitude and latitude."

OnTiles = Callable[[int, int], bool]
"""(done, total) → False to stop."""


@dataclass(frozen=True)
class Exported:
    path: Path
    tiles: int
    bytes: int


@dataclass(frozen=True)
class _Source:
    """`layer`: as exported; `stored`: the layer of the store that has its pixels, with `number`."""

    manifest: Manifest
    view: ManifestView
    layer: Layer
    stored: Layer
    number: int
    store: TileStore

    @property
    def suffix(self) -> str:
        return FILE_SUFFIXES[self.layer.format]

    def read(self, tile: TileId) -> bytes:
        """Raises Corrupt."""
        data = self.store.get_tile(self.number, *tile)
        if data is None:
            raise Corrupt(f"tile {tile.z}/{tile.x}/{tile.y} was removed during the export; export again")
        where = f"{self.store.url}: tile {self.stored.name}/{tile.z}/{tile.x}/{tile.y}"
        return as_layer(self.layer, self.stored, data, self.manifest.tile_px, where)

    def identity(self) -> str:
        """Returns a text that differs for other tiles."""
        return json.dumps([self.manifest.name, self.view.frame.id, self.layer.name, self.store.layer_digest(self.number)])


def export(
    workspace: Workspace, rendering: str, out: Path, *, to: ExportFormat, view: str, layer: str = "color", progress: OnTiles | None = None
) -> Exported:
    """Writes the tiles of a view and layer. `out`: a file for MBTiles and DZI (`NAME.dzi`, with the tiles in `NAME_files`), a folder for XYZ.

    Raises NotFound, BadRequest, AlreadyExists, Stopped, StoreError; Corrupt if tiles change meanwhile.
    """
    out = out.absolute()
    record = rendering_record(workspace, rendering)
    data = read_manifest(workspace, record)
    if data is None:
        raise NotFound(f"rendering {rendering!r} has no tiles yet; run: map3d render {rendering}")
    manifest = Manifest.load(data, str(workspace.manifest_path(rendering)))
    found = manifest.view(view)
    if found is None:
        raise NotFound(f"rendering {rendering!r} has no view {view!r}; its views are {', '.join(one.frame.id for one in manifest.views)}")
    holder = find_layer(manifest.layers, layer)
    if holder is None:
        raise NotFound(f"rendering {rendering!r} has no layer {layer!r}; its layers are {', '.join(layer_names(manifest.layers))}")
    number = next(number for number, layers in enumerate(manifest.passes) if holder[1] in layers)
    with open_track(workspace, record, track_id(view, number)) as store:
        chosen = find_layer(store.shape.layers, layer)
        assert chosen is not None, "the store has the layers of the manifest"
        source = _Source(manifest, found, *chosen, store.shape.layer_number(chosen[1].name), store)
        try:
            return _export(source, _WRITERS[to](source, out), progress or (lambda *_: True))
        except (OSError, sqlite3.Error) as error:
            raise StoreError(f"{out}: cannot write: {error}") from error


def _export(source: _Source, writer: "_Writer", progress: OnTiles) -> Exported:
    total, size = source.view.occupancy.count(), 0
    before = source.identity()
    writer.start(before)
    done = 0
    for done, tile in enumerate(source.store.list_tiles(source.number), 1):
        data = source.read(tile)
        size += len(data)
        writer.add(tile, data)
        if done % TILES_PER_STEP == 0 and not progress(done, max(total, done)):
            writer.stop()
            raise Stopped(f"export stopped after {done:,} tiles; run it again to resume")
    if source.identity() != before:
        writer.stop()
        raise Corrupt(f"rendering {source.manifest.name}: tiles changed during the export; wait until no render runs, then export again")
    writer.finish()
    progress(done, done)
    return Exported(writer.out, done, size)


class _Writer(ABC):
    def __init__(self, source: _Source, out: Path) -> None:
        self.source, self.out = source, out

    @abstractmethod
    def start(self, identity: str) -> None: ...

    @abstractmethod
    def add(self, tile: TileId, data: bytes) -> None: ...

    @abstractmethod
    def stop(self) -> None: ...

    @abstractmethod
    def finish(self) -> None: ...


class _MbtilesWriter(_Writer):
    """MBTiles 1.3: an SQLite file whose rows count from the bottom. A stopped export begins again."""

    def start(self, identity: str) -> None:
        _check_absent(self.out)
        self._draft = self.out.with_name(f".{self.out.name}.part")
        self._draft.unlink(missing_ok=True)
        self.out.parent.mkdir(parents=True, exist_ok=True)
        self._db = sqlite3.connect(self._draft, isolation_level=None)
        self._db.execute("PRAGMA journal_mode = OFF")
        self._db.execute("PRAGMA application_id = 0x4D504258")
        self._db.execute("CREATE TABLE metadata(name TEXT, value TEXT)")
        self._db.execute("CREATE TABLE tiles(zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB)")
        self._db.execute("BEGIN")
        self._db.executemany("INSERT INTO metadata VALUES (?, ?)", self._metadata().items())

    def _metadata(self) -> dict[str, str]:
        manifest, view, layer = self.source.manifest, self.source.view, self.source.layer
        return {
            "name": f"{manifest.title or manifest.name}: {view.frame.id}, {layer.name}",
            "format": self.source.suffix if layer.format in _MBTILES_FORMATS else layer.media_type,
            "minzoom": "0",
            "maxzoom": str(manifest.zmax),
            "type": "baselayer",
            "version": "1.3",
            "attribution": manifest.attribution,
            "description": NOTE,
        }

    def add(self, tile: TileId, data: bytes) -> None:
        self._db.execute("INSERT INTO tiles VALUES (?, ?, ?, ?)", (tile.z, tile.x, 2**tile.z - 1 - tile.y, data))

    def stop(self) -> None:
        self._db.close()
        self._draft.unlink(missing_ok=True)

    def finish(self) -> None:
        with closing(self._db) as db:
            db.execute("COMMIT")
            db.execute("CREATE UNIQUE INDEX tile_index ON tiles(zoom_level, tile_column, tile_row)")
        _sync(self._draft)
        self._draft.replace(self.out)


class _FilesWriter(_Writer):
    """One file per tile, in a draft folder that is renamed at the end."""

    def start(self, identity: str) -> None:
        self._folder = self._target()
        for path in {self.out, self._folder}:
            _check_absent(path)
        self._draft = self._folder.with_name(f".{self._folder.name}.exporting")
        marker = self._draft / MARKER
        if not marker.is_file() or marker.read_text() != identity:
            shutil.rmtree(self._draft, ignore_errors=True)
            self._draft.mkdir(parents=True)
            marker.write_text(identity)

    def _target(self) -> Path:
        return self.out

    def add(self, tile: TileId, data: bytes) -> None:
        self._write(self._name(tile), data)

    def _name(self, tile: TileId) -> str:
        return f"{tile.z}/{tile.x}/{tile.y}.{self.source.suffix}"

    def _write(self, name: str, data: bytes) -> None:
        """Keeps a file of an earlier attempt, which was complete when it was renamed."""
        path = self._draft / name
        if path.is_file():
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(f".{path.name}.part")
        part.write_bytes(data)
        part.replace(path)

    def stop(self) -> None:
        pass

    def finish(self) -> None:
        for part in self._draft.rglob(".*.part"):
            part.unlink()
        (self._draft / MARKER).unlink()
        self._draft.rename(self._folder)


class _DziWriter(_FilesWriter):
    """Deep Zoom Image: its levels count from 1 px, so level 0 of the pyramid is level log2(tile_px), and smaller levels are shrunk from it."""

    def _target(self) -> Path:
        if self.out.suffix != ".dzi":
            raise BadRequest(f"{self.out}: the name of a Deep Zoom Image ends with .dzi")
        if self.source.layer.kind == "data":
            raise BadRequest(f"layer {self.source.layer.name}: data tiles are no images; export {', '.join(DATA_TILE_KINDS)}, or to mbtiles or xyz")
        return self.out.with_name(f"{self.out.stem}_files")

    def _first_level(self) -> int:
        return self.source.manifest.tile_px.bit_length() - 1

    def _name(self, tile: TileId) -> str:
        return f"{self._first_level() + tile.z}/{tile.x}_{tile.y}.{self.source.suffix}"

    def add(self, tile: TileId, data: bytes) -> None:
        super().add(tile, data)
        if tile.z == 0:
            self._shrink(data)

    def _shrink(self, data: bytes) -> None:
        method = Image.Resampling.BOX if self.source.layer.kind in COLOR_KINDS else Image.Resampling.NEAREST
        pixels = decode_channels(self.source.layer, data, self.source.manifest.tile_px)
        with Image.fromarray(pixels.squeeze(axis=2) if pixels.shape[2] == 1 else pixels) as whole:
            for level in range(self._first_level()):
                shrunk = io.BytesIO()
                with whole.resize((1 << level, 1 << level), method) as small:
                    small.save(shrunk, self.source.layer.format, quality=90)
                self._write(f"{level}/0_0.{self.source.suffix}", shrunk.getvalue())

    def finish(self) -> None:
        super().finish()
        draft = self.out.with_name(f".{self.out.name}.part")
        draft.write_text(self._description(), "utf-8")
        _sync(draft)
        draft.replace(self.out)

    def _description(self) -> str:
        """Names the rectangle of each level that has tiles, so that viewers ask for no others."""
        manifest, first = self.source.manifest, self._first_level()
        side = manifest.tile_px << manifest.zmax
        rows = [f'  <DisplayRect MinLevel="0" MaxLevel="{first - 1}"><Rect X="0" Y="0" Width="{side}" Height="{side}"/></DisplayRect>']
        for z in range(manifest.zmax + 1):
            tiles = list(self.source.view.occupancy.tiles(z))
            if not tiles:
                continue
            step = side >> z
            left, top = min(tile.x for tile in tiles), min(tile.y for tile in tiles)
            width, height = max(tile.x for tile in tiles) + 1 - left, max(tile.y for tile in tiles) + 1 - top
            rect = f'<Rect X="{left * step}" Y="{top * step}" Width="{width * step}" Height="{height * step}"/>'
            rows.append(f'  <DisplayRect MinLevel="{first + z}" MaxLevel="{first + z}">{rect}</DisplayRect>')
        return (
            '<?xml version="1.0" encoding="UTF-8"?>\n'
            f'<Image xmlns="{_NAMESPACE}" TileSize="{manifest.tile_px}" Overlap="0" Format="{self.source.suffix}">\n'
            f' <Size Width="{side}" Height="{side}"/>\n <DisplayRects>\n' + "\n".join(rows) + "\n </DisplayRects>\n</Image>\n"
        )


_WRITERS: Final[dict[ExportFormat, type[_Writer]]] = {"mbtiles": _MbtilesWriter, "xyz": _FilesWriter, "dzi": _DziWriter}


def _check_absent(path: Path) -> None:
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise AlreadyExists(f"{path}: exists; remove it, or name another path")


def _sync(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
