"""Checkpoints of a terrain: runs of tiles that threads build and store, each in one file, until the asset is written.

A checkpoint is renamed into place when it is complete. An import that was killed uses the checkpoints that it finds; the folder belongs to one set
of rasters and options (map3d.ingest.import_checkpoints), so that others start from scratch.
"""

import json
import os
import threading
import zipfile
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import rasterio

from map3d.ingest.terrain.orthophoto import TextureTile
from map3d.ingest.terrain.terrain_tiles import TerrainTile, TileBuilder, TileCounts
from map3d.ingest.terrain.vertex_grid import GridTile

CHECKPOINTS: Final = 1000
"""Approximate number of checkpoints of a terrain; a terrain with fewer tiles has one for each."""

MAX_CHECKPOINT_TILES: Final = 64
GDAL_CACHE_MB: Final = 64
_TABLE: Final = "tiles.json"
_ARRAYS: Final = ("positions", "triangles", "uvs")


@dataclass(frozen=True)
class TerrainCheckpoint:
    """A stored checkpoint."""

    path: Path
    counts: TileCounts
    tiles: list[dict[str, Any]]

    @classmethod
    def read(cls, path: Path) -> Self | None:
        """Returns None for an absent or damaged checkpoint, or one whose textures are not there."""
        try:
            with zipfile.ZipFile(path) as file:
                table = json.loads(file.read(_TABLE))
            checkpoint = cls(path, TileCounts(**table["counts"]), table["tiles"])
            sizes_match = all((texture_folder(path.parent) / name).stat().st_size == size for name, size in checkpoint.textures())
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
            return None
        return checkpoint if sizes_match else None

    def textures(self) -> Iterator[tuple[str, int]]:
        """Yields the names and sizes in bytes of the image files."""
        yield from ((row["file"], row["bytes"]) for row in self.tiles if row["file"])

    def read_tiles(self) -> Iterator[TerrainTile]:
        with zipfile.ZipFile(self.path) as file:
            for number, row in enumerate(self.tiles):
                positions, triangles, uvs = (_read_array(file, f"{number}.{name}") if name != "uvs" or row["uvs"] else None for name in _ARRAYS)
                texture = row["texture"] and TextureTile(**{**row["texture"], "scale": tuple(row["texture"]["scale"])})
                assert positions is not None, "a tile has triangles"
                assert triangles is not None, "a tile has triangles"
                yield TerrainTile(row["row"], row["column"], positions, triangles, uvs, texture)


def texture_folder(checkpoints: Path) -> Path:
    """Returns the folder for the textures of the checkpoints."""
    return checkpoints / "textures"


def build_checkpoints(
    tiles: Iterable[GridTile], tile_count: int, folder: Path, workers: int, open_builder: Callable[[], TileBuilder]
) -> Generator[tuple[TerrainCheckpoint, int], None, None]:
    """Yields the checkpoints in order, with the numbers of tiles that `tiles` had in them; builds those that are not in `folder`.

    `workers`: threads, each of which opens a builder. A thread that waits for others has at most a few checkpoints in advance. Raises ImportFailed.
    """
    texture_folder(folder).mkdir(parents=True, exist_ok=True)
    for left in folder.glob("*.new"):
        left.unlink(missing_ok=True)
    source = enumerate(_runs(tiles, min(MAX_CHECKPOINT_TILES, -(-tile_count // CHECKPOINTS))))
    with _Builders(open_builder) as builders, ThreadPoolExecutor(workers) as pool:
        waiting: list[tuple[Future[TerrainCheckpoint], int]] = []
        try:
            while True:
                for number, run in islice(source, 2 * workers - len(waiting)):
                    waiting.append((pool.submit(_get_checkpoint, folder / f"{number}.zip", run, builders), len(run)))
                if not waiting:
                    return
                future, count = waiting.pop(0)
                yield future.result(), count
        finally:
            pool.shutdown(cancel_futures=True)


class _Builders:
    """A builder for each thread. Context manager; the threads have ended when it exits."""

    def __init__(self, open_builder: Callable[[], TileBuilder]) -> None:
        self._open, self._own, self._lock = open_builder, threading.local(), threading.Lock()
        self._all: list[TileBuilder] = []

    def get(self) -> TileBuilder:
        builder: TileBuilder | None = getattr(self._own, "builder", None)
        if builder is None:
            builder = self._own.builder = self._open()
            with self._lock:
                self._all.append(builder)
        return builder

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for builder in self._all:
            builder.close()


def _runs(tiles: Iterable[GridTile], length: int) -> Iterator[list[GridTile]]:
    source = iter(tiles)
    while run := list(islice(source, length)):
        yield run


def _get_checkpoint(path: Path, run: list[GridTile], builders: _Builders) -> TerrainCheckpoint:
    known = TerrainCheckpoint.read(path)
    if known is not None:
        return known
    with rasterio.Env(GDAL_CACHEMAX=GDAL_CACHE_MB):
        return _write_checkpoint(path, run, builders.get())


def _write_checkpoint(path: Path, run: list[GridTile], builder: TileBuilder) -> TerrainCheckpoint:
    textures, counts = texture_folder(path.parent), TileCounts()
    rows: list[dict[str, Any]] = []
    draft = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_ident()}.new")
    try:
        with zipfile.ZipFile(draft, "w") as file:
            for tile in run:
                built = builder.build(tile, textures, counts)
                if built is not None:
                    _write_arrays(file, len(rows), built)
                    rows.append(_row(built, textures))
            file.writestr(_TABLE, json.dumps({"counts": asdict(counts), "tiles": rows}))
        draft.replace(path)
    except BaseException:
        with suppress(OSError):
            draft.unlink()
        raise
    return TerrainCheckpoint(path, counts, rows)


def _row(tile: TerrainTile, textures: Path) -> dict[str, Any]:
    name = None if tile.texture is None else tile.texture.file_name
    return {
        "row": tile.row,
        "column": tile.column,
        "uvs": tile.uvs is not None,
        "texture": None if tile.texture is None else asdict(tile.texture),
        "file": name,
        "bytes": 0 if name is None else (textures / name).stat().st_size,
    }


def _write_arrays(file: zipfile.ZipFile, number: int, tile: TerrainTile) -> None:
    for name in _ARRAYS:
        array = getattr(tile, name)
        if array is not None:
            with file.open(f"{number}.{name}", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def _read_array(file: zipfile.ZipFile, name: str) -> Any:
    with file.open(name) as member:
        return np.lib.format.read_array(member, allow_pickle=False)
