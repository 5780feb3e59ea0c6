import json
from pathlib import Path

import pytest

from map3d.errors import BadRequest
from map3d.tiles import naming
from map3d.types import BlockId, TileId

VECTORS = Path(__file__).parents[2] / "spec" / "vectors"
TILES = json.loads((VECTORS / "tiles.json").read_text())["rows"]
BLOCKS = json.loads((VECTORS / "blocks.json").read_text())


def all_tiles(zmax):
    return [TileId(z, x, y) for z in range(zmax + 1) for x in range(2**z) for y in range(2**z)]


@pytest.mark.parametrize("row", TILES)
def test_names_match_the_vectors(row):
    tile = TileId(*row["tile"])
    assert naming.morton(tile.x, tile.y) == row["morton"]
    assert naming.parent(tile) == (tuple(row["parent"]) if row["parent"] else None)


@pytest.mark.parametrize("row", BLOCKS, ids=lambda row: f"zmax{row['zmax']}")
def test_root_levels_match_the_vectors(row):
    assert [list(level) for level in naming.block_levels(row["zmax"])] == row["blocks"]


def test_parent_of_child_is_itself():
    for tile in all_tiles(4):
        assert [naming.parent(child) for child in naming.children(tile)] == [tile] * 4


def test_children_are_in_morton_order():
    numbers = [naming.morton(child.x, child.y) for child in naming.children(TileId(5, 17, 3))]
    assert numbers == list(range(4 * naming.morton(17, 3), 4 * naming.morton(17, 3) + 4))


def test_morton_numbers_read_back():
    for x, y in [(0, 0), (1, 0), (0, 1), (2**26 - 1, 0), (0, 2**26 - 1), (2**26 - 1, 2**26 - 1), (12345678, 7654321)]:
        assert naming.from_morton(naming.morton(x, y)) == (x, y)


@pytest.mark.parametrize("zmax", range(8))
def test_each_tile_is_in_exactly_one_block(zmax):
    held = {}
    for level in naming.block_levels(zmax):
        for x in range(2**level.root):
            for y in range(2**level.root):
                block = BlockId(level.root, x, y)
                for tile in naming.tiles_of_block(block, zmax):
                    assert tile not in held
                    assert naming.block_of(tile, zmax) == block
                    held[tile] = block
    assert set(held) == set(all_tiles(zmax))


def test_a_base_block_has_85_tiles_in_morton_order():
    tiles = list(naming.tiles_of_block(BlockId(2, 1, 3), 5))
    assert len(tiles) == 64 + 16 + 4 + 1
    assert tiles == naming.sort_by_morton(tiles)


@pytest.mark.parametrize("zmax", range(11))
def test_blocks_below_and_block_above_are_inverse(zmax):
    for level in naming.block_levels(zmax):
        block = BlockId(level.root, 2**level.root - 1, 0)
        below = naming.blocks_below(block, zmax)
        assert len(below) == (4**level.levels if level.kind == "reduce" else 0)
        assert all(naming.block_above(one, zmax) == block for one in below)
    assert naming.block_above(BlockId(0, 0, 0), zmax) is None


def test_every_tile_number_reads_back():
    for tile in [*all_tiles(3), TileId(26, 2**26 - 1, 0), TileId(26, 0, 2**26 - 1)]:
        assert naming.parse_tile(*map(str, tile)) == tile


@pytest.mark.parametrize(
    "text",
    [
        ("", "0", "0"), ("00", "0", "0"), ("1", "01", "0"), ("-1", "0", "0"), ("1", "+1", "0"), ("1", "2", "0"), ("1", "0", "2"), ("0", "-0", "0"),
        ("27", "0", "0"), ("26", "67108864", "0"), ("1", "1.0", "0"), ("1", "1e0", "0"), ("1", " 1", "0"), ("1", "1\n", "0"), ("1", "١", "0"),
        ("1", "²", "0"), ("0x1", "0", "0"), ("1", "9" * 5000, "0"), ("1", "1_0", "0"), ("1", "", "0"),
    ],
)  # fmt: skip
def test_anything_but_plain_tile_numbers_is_none(text):
    assert naming.parse_tile(*text) is None


@pytest.mark.parametrize("tile", [(-1, 0, 0), (27, 0, 0), (0, 1, 0), (3, -1, 0), (3, 0, 8)])
def test_tiles_out_of_range_are_refused(tile):
    with pytest.raises(BadRequest, match="out of range"):
        naming.check_tile(TileId(*tile))


def test_impossible_blocks_and_ancestors_are_refused():
    with pytest.raises(BadRequest, match="below the deepest"):
        naming.block_of(TileId(5, 0, 0), 4)
    with pytest.raises(BadRequest, match="rooted"):
        naming.block_level(2, 4)
    with pytest.raises(BadRequest, match="ancestor"):
        naming.ancestor(TileId(2, 0, 0), 3)
