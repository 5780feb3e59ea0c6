"""Disk space that stores and published archives save by storing equal tiles once: `python -m bench stored --folders FOLDER…`."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pmtiles.reader
from rich.console import Console
from rich.table import Table

from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import content_hash


@dataclass(frozen=True)
class DuplicateRow:
    """Sizes of a layer; `each_bytes`: without, `kept_bytes`: with deduplication; `entries`: number of an archive's directory entries."""

    file: str
    layer: str
    tiles: int
    distinct: int
    each_bytes: int
    kept_bytes: int
    entries: int | None = None


def measure(folders: list[Path]) -> list[dict[str, Any]]:
    """Measures each layer of the tile stores and archives in some folders, and prints the table."""
    rows = [row for folder in folders for path in sorted(folder.rglob("*")) for row in measure_file(path)]
    table = Table(title="equal tiles", title_justify="left")
    for column in ("file", "layer", "tiles", "distinct", "without sharing, MB", "stored, MB", "saved", "entries"):
        table.add_column(column, justify="left" if column in ("file", "layer") else "right")
    for row in rows:
        saved = 1 - row.kept_bytes / row.each_bytes if row.each_bytes else 0.0
        sizes = f"{row.each_bytes / 1e6:.2f}", f"{row.kept_bytes / 1e6:.2f}", f"{100 * saved:.2f} %"
        table.add_row(row.file, row.layer, f"{row.tiles:,}", f"{row.distinct:,}", *sizes, "" if row.entries is None else f"{row.entries:,}")
    Console(width=160).print(table)
    return [asdict(row) for row in rows]


def measure_file(path: Path) -> Iterator[DuplicateRow]:
    if path.suffix == ".pmtiles":
        yield measure_archive(path)
    elif path.suffix == ".sqlite" and path.parent.parent.name == "renderings":
        yield from measure_store(path)


def measure_store(path: Path) -> Iterator[DuplicateRow]:
    """Yields a row per layer. `kept_bytes` is the size of its distinct tiles, though the store also shares tiles between layers."""
    with SqliteTileStore(path, read_only=True) as store:
        for number, layer in enumerate(store.shape.layers):
            sizes, total, count = {}, 0, 0
            for tile in store.list_tiles(number):
                data = store.get_tile(number, *tile) or b""
                sizes[content_hash(data)] = len(data)
                total, count = total + len(data), count + 1
            yield DuplicateRow(path.name, layer.name, count, len(sizes), total, sum(sizes.values()))


def measure_archive(path: Path) -> DuplicateRow:
    """Returns the row of an archive; `kept_bytes` is the length of its tile data."""
    with path.open("rb") as file:
        source = pmtiles.reader.MmapSource(file)
        header = pmtiles.reader.Reader(source).header()
        tiles = [data for _, data in pmtiles.reader.traverse(source, header, header["root_offset"], header["root_length"])]
    distinct = len({content_hash(data) for data in tiles})
    kept, entries = header["tile_data_length"], header["tile_entries_count"]
    return DuplicateRow(path.name, path.parent.name, len(tiles), distinct, sum(map(len, tiles)), kept, entries)
