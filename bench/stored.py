"""How much room equal tiles would take if each were kept by itself, in stores and published archives. `python -m bench stored --folders FOLDER…`."""

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
class Row:
    """`distinct` of the `tiles` differ; `each_bytes` if every tile lay by itself, `kept_bytes` as it is; `entries` of an archive's directories."""

    file: str
    layer: str
    tiles: int
    distinct: int
    each_bytes: int
    kept_bytes: int
    entries: int | None = None


def measure(folders: list[Path]) -> list[dict[str, Any]]:
    """Rows for each layer of the tile stores and archives below some folders; the table is printed."""
    rows = [row for folder in folders for path in sorted(folder.rglob("*")) for row in of_file(path)]
    table = Table(title="equal tiles", title_justify="left")
    for column in ("file", "layer", "tiles", "distinct", "each by itself, MB", "as kept, MB", "saved", "entries"):
        table.add_column(column, justify="left" if column in ("file", "layer") else "right")
    for row in rows:
        saved = 1 - row.kept_bytes / row.each_bytes if row.each_bytes else 0.0
        sizes = f"{row.each_bytes / 1e6:.2f}", f"{row.kept_bytes / 1e6:.2f}", f"{100 * saved:.2f} %"
        table.add_row(row.file, row.layer, f"{row.tiles:,}", f"{row.distinct:,}", *sizes, "" if row.entries is None else f"{row.entries:,}")
    Console(width=160).print(table)
    return [asdict(row) for row in rows]


def of_file(path: Path) -> Iterator[Row]:
    if path.suffix == ".pmtiles":
        yield of_archive(path)
    elif path.suffix == ".sqlite" and path.parent.parent.name == "renderings":
        yield from of_store(path)


def of_store(path: Path) -> Iterator[Row]:
    """By layer. What is kept are the bytes of distinct tiles; the store shares them between layers too."""
    with SqliteTileStore(path, read_only=True) as store:
        for number, layer in enumerate(store.shape.layers):
            sizes, total, count = {}, 0, 0
            for tile in store.list_tiles(number):
                data = store.get_tile(number, *tile) or b""
                sizes[content_hash(data)] = len(data)
                total, count = total + len(data), count + 1
            yield Row(path.name, layer.name, count, len(sizes), total, sum(sizes.values()))


def of_archive(path: Path) -> Row:
    """What is kept is the length of the archive's tile data."""
    with path.open("rb") as file:
        source = pmtiles.reader.MmapSource(file)
        header = pmtiles.reader.Reader(source).header()
        tiles = [data for _, data in pmtiles.reader.traverse(source, header, header["root_offset"], header["root_length"])]
    distinct = len({content_hash(data) for data in tiles})
    kept, entries = header["tile_data_length"], header["tile_entries_count"]
    return Row(path.name, path.parent.name, len(tiles), distinct, sum(map(len, tiles)), kept, entries)
