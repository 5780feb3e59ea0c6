"""Directories of large archives: small leaves that the PMTiles library reads back."""

import gzip

import numpy as np
import pmtiles.tile
import pytest
from pmtiles.tile import Entry

from map3d.publish.pmtiles_archive import LEAF_ENTRIES, _build_directories

ROOT_BYTES = 16_384 - 127


def entries(count: int) -> list[Entry]:
    """Returns entries like those of a city: different lengths, some runs, some gaps."""
    rng = np.random.default_rng(7)
    ids, offset, made = np.cumsum(rng.integers(1, 4, count)), 0, []
    for number, length in zip(ids, rng.integers(200, 20_000, count), strict=True):
        made.append(Entry(int(number), offset, int(length), 1))
        offset += int(length)
    return made


def flat(root: bytes, leaves: bytes) -> list[Entry]:
    found = []
    for entry in pmtiles.tile.deserialize_directory(root):
        if entry.run_length:
            found.append(entry)
        else:
            found += pmtiles.tile.deserialize_directory(leaves[entry.offset : entry.offset + entry.length])
    return found


def fields(entry: Entry) -> tuple[int, int, int, int]:
    return entry.tile_id, entry.offset, entry.length, entry.run_length


@pytest.mark.parametrize(("count", "room"), [(1, ROOT_BYTES), (300, ROOT_BYTES), (6_000, ROOT_BYTES), (6_000, 60)])
def test_every_entry_reads_back(count: int, room: int) -> None:
    asked = entries(count)
    root, leaves, number = _build_directories(asked, room)
    assert len(root) < room
    assert list(map(fields, flat(root, leaves))) == list(map(fields, asked))
    assert number == (0 if not leaves else len(pmtiles.tile.deserialize_directory(root)))


def test_a_leaf_is_a_kilobyte_where_the_root_has_room() -> None:
    root, leaves, number = _build_directories(entries(20_000), ROOT_BYTES)
    assert number == -(-20_000 // LEAF_ENTRIES)
    assert max(entry.length for entry in pmtiles.tile.deserialize_directory(root)) < 1_500
    assert gzip.decompress(leaves[: pmtiles.tile.deserialize_directory(root)[0].length])
