"""One pyramid as a PMTiles archive: tiles in the order of their ids, equal tiles once, the tile numbers of the pyramid unchanged."""

import itertools
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, BinaryIO, Final

import pmtiles.reader
import pmtiles.writer
from pmtiles.tile import Compression, Entry, TileType, tileid_to_zxy, zxy_to_tileid

from map3d.errors import Corrupt
from map3d.tiles.store import TileStore, content_hash
from map3d.types import Layer, TileId

_reading: Any = pmtiles.reader
_writing: Any = pmtiles.writer

TILE_TYPES: Final = {"webp": TileType.WEBP, "png": TileType.PNG, "jpeg": TileType.JPEG}
PER_STEP: Final = 256
LEAF_ENTRIES: Final = 256
"""Tiles of a leaf directory, 0.9 kB or so: who looks at one place of a large pyramid reads four or five of them. Doubled until the root fits."""

Step = Callable[[int], None]
"""Told of every few tiles written; stops the work by raising."""


def write_archive(store: TileStore, layer: int, path: Path, metadata: dict[str, Any], step: Step) -> int:
    """Writes the archive and returns how many tiles it has; it appears under `path` when whole and durable. A pyramid without tiles has none."""
    ids = sorted(zxy_to_tileid(*tile) for tile in store.list_tiles(layer))
    if not ids:
        return 0
    draft = path.with_name(path.name + ".part")
    path.parent.mkdir(parents=True, exist_ok=True)
    with draft.open("wb") as file, tempfile.TemporaryFile(dir=path.parent) as data:
        writer = _writer(file, data)
        for done, tile_id in enumerate(ids, 1):
            _write_tile(writer, tile_id, _tile(store, layer, TileId(*tileid_to_zxy(tile_id))))
            if done % PER_STEP == 0 or done == len(ids):
                step((done - 1) % PER_STEP + 1)
        with _small_leaves():
            writer.finalize({"tile_type": TILE_TYPES[store.shape.layers[layer].format], "tile_compression": Compression.NONE}, metadata)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
    return len(ids)


class Archive:
    """A written archive, open for reading."""

    def __init__(self, path: Path) -> None:
        """Raises Corrupt unless it is an archive of raster tiles."""
        self.path = path
        try:
            with path.open("rb") as file:
                self._source = _reading.MmapSource(file)
            self._reader = _reading.Reader(self._source)
            self._header = self._reader.header()
            self.metadata: dict[str, Any] = self._reader.metadata()
        except Exception as error:
            raise Corrupt(f"{path}: not a PMTiles archive: {type(error).__name__}: {error}") from error

    def is_of(self, layer: Layer) -> bool:
        """Whether it says that its tiles are of the layer's format."""
        return bool(self._header["tile_type"] == TILE_TYPES[layer.format] and self._header["tile_compression"] == Compression.NONE)

    @property
    def clustered(self) -> bool:
        return bool(self._header["clustered"])

    def tiles(self) -> Iterator[tuple[TileId, bytes]]:
        """In the order of their ids; raises Corrupt where one reaches beyond the file."""
        end = self._header["tile_data_offset"] + self._header["tile_data_length"]
        try:
            if end != self.path.stat().st_size:
                raise Corrupt(f"{self.path}: is {self.path.stat().st_size} bytes, expected {end}; copy it again")
            for (z, x, y), data in _reading.traverse(self._source, self._header, self._header["root_offset"], self._header["root_length"]):
                yield TileId(z, x, y), data
        except (OSError, EOFError, ValueError, IndexError) as error:
            raise Corrupt(f"{self.path}: a directory is damaged: {error}") from error


def _writer(file: BinaryIO, data: IO[bytes]) -> Any:
    """Keeps tile data beside the archive, not in the system's temporary folder."""
    writer = _writing.Writer(file)
    writer.tile_f.close()
    writer.tile_f = data
    return writer


@contextmanager
def _small_leaves() -> Iterator[None]:
    """The writer's own leaves begin at 4,096 entries, 13 kB each, for the sake of whole planets."""
    its_own = _writing.optimize_directories
    _writing.optimize_directories = _directories
    try:
        yield
    finally:
        _writing.optimize_directories = its_own


def _directories(entries: list[Entry], root_bytes: int) -> tuple[bytes, bytes, int]:
    """Root and leaf directories, and how many leaves; the root is shorter than `root_bytes`."""
    whole: bytes = _writing.serialize_directory(entries)
    if len(whole) < root_bytes:
        return whole, b"", 0
    for doubling in itertools.count():
        root, leaves, count = _writing.build_roots_leaves(entries, LEAF_ENTRIES << doubling)
        if len(root) < root_bytes:
            return root, leaves, count
    raise AssertionError("unreachable")


def _write_tile(writer: Any, tile_id: int, data: bytes) -> None:
    """As the writer's own, which knows equal tiles by a hash of 64 bits that differs from run to run; by their content's hash here."""
    digest = content_hash(data)
    found = writer.hash_to_offset.get(digest)
    if found is None:
        found = writer.hash_to_offset[digest] = writer.offset
        writer.tile_f.write(data)
        writer.offset += len(data)
    last: Entry | None = writer.tile_entries[-1] if writer.tile_entries else None
    if last is not None and tile_id == last.tile_id + last.run_length and last.offset == found:
        last.run_length += 1
    else:
        writer.tile_entries.append(Entry(tile_id, found, len(data), 1))
    writer.addressed_tiles += 1


def _tile(store: TileStore, layer: int, tile: TileId) -> bytes:
    data = store.get_tile(layer, *tile)
    if data is None:
        raise Corrupt(f"tile {layer}: {tile.z}/{tile.x}/{tile.y} was removed while it was published; publish again")
    return data
