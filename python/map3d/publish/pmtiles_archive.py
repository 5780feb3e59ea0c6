"""Reads and writes one pyramid as a PMTiles archive: tiles sorted by id, equal tiles stored once, tile coordinates unchanged."""

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
from map3d.tiles.tile_store import TileStore, content_hash
from map3d.types import Layer, TileId

_reading: Any = pmtiles.reader
_writing: Any = pmtiles.writer

TILE_TYPES: Final = {"webp": TileType.WEBP, "png": TileType.PNG, "jpeg": TileType.JPEG, "m3d": TileType.UNKNOWN}
TILES_PER_STEP: Final = 256
COPY_BYTES: Final = 1 << 20
LEAF_ENTRIES: Final = 256
"""Tiles per leaf directory, about 0.9 kB. A client that shows one area of a large pyramid reads four or five. Doubled until the root fits."""

OnTilesWritten = Callable[[int], None]
"""Called with the number of tiles written since the last call. Stops the work by raising."""


def write_archive(store: TileStore, layer: int, path: Path, metadata: dict[str, Any], on_tiles_written: OnTilesWritten) -> int:
    """Writes the archive, which appears under `path` once complete and durable. Returns the number of tiles; without tiles it writes nothing."""
    ids = sorted(zxy_to_tileid(*tile) for tile in store.list_tiles(layer))
    if not ids:
        return 0
    draft = path.with_name(path.name + ".part")
    path.parent.mkdir(parents=True, exist_ok=True)
    with draft.open("wb") as file, tempfile.TemporaryFile(dir=path.parent) as data:
        writer = _create_writer(file, data)
        tiles = store.read_tiles(layer, (TileId(*tileid_to_zxy(tile_id)) for tile_id in ids))
        for done, (tile_id, found) in enumerate(zip(ids, tiles, strict=True), 1):
            _write_tile(writer, tile_id, _check_tile(layer, tile_id, found))
            if done % TILES_PER_STEP == 0 or done == len(ids):
                on_tiles_written((done - 1) % TILES_PER_STEP + 1)
        with _small_leaves():
            writer.finalize({"tile_type": TILE_TYPES[store.shape.layers[layer].format], "tile_compression": Compression.NONE}, metadata)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
    return len(ids)


class Archive:
    """A PMTiles archive, open for reading."""

    def __init__(self, path: Path, part_bytes: int = 0) -> None:
        """`part_bytes`: size of the files in which it is divided; 0 for one file. Raises Corrupt unless it is a PMTiles archive."""
        self.path = path
        try:
            self._files = existing_parts(path, part_bytes)
            self._source = _PartsSource(self._files, part_bytes) if part_bytes else _open_source(path)
            self._reader = _reading.Reader(self._source)
            self._header = self._reader.header()
            self.metadata: dict[str, Any] = self._reader.metadata()
        except Exception as error:
            raise Corrupt(f"{path}: not a PMTiles archive: {type(error).__name__}: {error}") from error

    def has_format_of(self, layer: Layer) -> bool:
        """Whether the header declares the layer's format."""
        return bool(self._header["tile_type"] == TILE_TYPES[layer.format] and self._header["tile_compression"] == Compression.NONE)

    @property
    def clustered(self) -> bool:
        return bool(self._header["clustered"])

    def count_tiles(self) -> int:
        """Returns the number of tiles. Raises Corrupt if the length of the file is wrong."""
        self._check_length()
        return int(self._header["addressed_tiles_count"])

    def _check_length(self) -> None:
        end = self._header["tile_data_offset"] + self._header["tile_data_length"]
        size = sum(file.stat().st_size for file in self._files)
        if end != size:
            raise Corrupt(f"{self.path}: the archive has {size} bytes, expected {end}; copy it again")

    def tiles(self) -> Iterator[tuple[TileId, bytes]]:
        """Yields the tiles by id. Raises Corrupt if a directory or the length of the file is wrong."""
        try:
            self._check_length()
            for (z, x, y), data in _reading.traverse(self._source, self._header, self._header["root_offset"], self._header["root_length"]):
                yield TileId(z, x, y), data
        except (OSError, EOFError, ValueError, IndexError) as error:
            raise Corrupt(f"{self.path}: damaged directory; publish or copy the archive again: {error}") from error


def part_path(path: Path, number: int) -> Path:
    """Returns the path of a part of an archive (spec/manifest.md)."""
    return path.with_suffix(f".{number}{path.suffix}")


def existing_parts(path: Path, part_bytes: int) -> list[Path]:
    """Returns the files of an archive that exist, in order."""
    return list(itertools.takewhile(Path.is_file, (part_path(path, number) for number in itertools.count()))) if part_bytes else [path]


def split_archive(path: Path, part_bytes: int) -> list[Path]:
    """Divides an archive into files of `part_bytes`, which replace it; returns their paths."""
    parts = []
    with path.open("rb") as whole:
        for number in range(-(-path.stat().st_size // part_bytes)):
            parts.append(part_path(path, number))
            parts[-1].unlink(missing_ok=True)
            with parts[-1].open("xb") as part:
                for length in [COPY_BYTES] * (part_bytes // COPY_BYTES) + [part_bytes % COPY_BYTES]:
                    part.write(whole.read(length))
                part.flush()
                os.fsync(part.fileno())
    path.unlink()
    return parts


class _PartsSource:
    """Reads a divided archive as the library wants it."""

    def __init__(self, files: list[Path], part_bytes: int) -> None:
        self._sources, self._part_bytes = [_open_source(file) for file in files], part_bytes

    def __call__(self, offset: int, length: int) -> bytes:
        pieces = []
        while length > 0:
            number, start = divmod(offset, self._part_bytes)
            size = min(length, self._part_bytes - start)
            if number >= len(self._sources):
                break
            pieces.append(self._sources[number](start, size))
            offset, length = offset + size, length - size
        return b"".join(pieces)


def _open_source(path: Path) -> Any:
    with path.open("rb") as file:
        return _reading.MmapSource(file)


def _create_writer(file: BinaryIO, data: IO[bytes]) -> Any:
    """Buffers tile data in `data`, beside the archive, instead of the system's temporary folder."""
    writer = _writing.Writer(file)
    writer.tile_f.close()
    writer.tile_f = data
    return writer


@contextmanager
def _small_leaves() -> Iterator[None]:
    """Replaces the library's directories, whose leaves start at 4,096 entries (13 kB), by smaller ones."""
    original = _writing.optimize_directories
    _writing.optimize_directories = _build_directories
    try:
        yield
    finally:
        _writing.optimize_directories = original


def _build_directories(entries: list[Entry], root_bytes: int) -> tuple[bytes, bytes, int]:
    """Returns the root directory, the leaf directories and their number. The root is shorter than `root_bytes`."""
    root_only: bytes = _writing.serialize_directory(entries)
    if len(root_only) < root_bytes:
        return root_only, b"", 0
    for doubling in itertools.count():
        root, leaves, count = _writing.build_roots_leaves(entries, LEAF_ENTRIES << doubling)
        if len(root) < root_bytes:
            return root, leaves, count
    raise AssertionError("unreachable")


def _write_tile(writer: Any, tile_id: int, data: bytes) -> None:
    """Deduplicates by content hash. The library uses a 64-bit hash that differs from run to run."""
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


def _check_tile(layer: int, tile_id: int, data: bytes | None) -> bytes:
    if data is None:
        tile = TileId(*tileid_to_zxy(tile_id))
        raise Corrupt(f"tile {layer}: {tile.z}/{tile.x}/{tile.y} was removed during publishing; publish again")
    return data
