import base64
import json
from pathlib import Path

import numpy as np
import pytest

from map3d.errors import BadRequest, Corrupt
from map3d.tiles.naming import block_levels, children, morton, parent, tiles_of_block
from map3d.tiles.occupancy import Occupancy, block_bits, morton_numbers, union_of, xy_from_morton
from map3d.types import BlockId, TileId

VECTORS = json.loads((Path(__file__).parents[2] / "spec" / "vectors" / "occupancy.json").read_text())


def from_grid(grid):
    """Returns the occupancy of a (2^zmax, 2^zmax) array of flags [y, x]."""
    rows, columns = np.nonzero(grid)
    return Occupancy.from_tiles(len(grid).bit_length() - 1, zip(columns, rows, strict=True))


def random_occupancy(zmax, share, seed=3):
    grid = np.random.default_rng(seed).random((2**zmax, 2**zmax)) < share
    return grid, from_grid(grid)


@pytest.mark.parametrize("row", VECTORS, ids=lambda row: row["base64"])
def test_occupancy_follows_the_vectors(row):
    occupancy = Occupancy.from_tiles(row["zmax"], map(tuple, row["occupied"]))
    assert occupancy.encode() == row["base64"]
    decoded = Occupancy.decode(row["zmax"], row["base64"])
    assert decoded == occupancy
    assert [[tile.x, tile.y] for tile in decoded.tiles(row["zmax"])] == row["occupied"]


@pytest.mark.parametrize("zmax", range(7))
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
def test_decode_undoes_encode(zmax, share):
    grid, occupancy = random_occupancy(zmax, share)
    assert Occupancy.decode(zmax, occupancy.encode()) == occupancy
    assert occupancy.count(zmax) == grid.sum()


@pytest.mark.parametrize("zmax", range(8))
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
def test_an_occupancy_is_made_of_its_blocks(zmax, share):
    _, occupancy = random_occupancy(zmax, share)
    root = block_levels(zmax)[0].root
    blocks = [BlockId(root, x, y) for x in range(2**root) for y in range(2**root)]
    rows = [(block.x, block.y, block_bits(block, zmax, [tile for tile in tiles_of_block(block, zmax) if tile in occupancy])) for block in blocks]
    assert all(0 <= bits < 2**64 for _, _, bits in rows)
    assert Occupancy.from_blocks(zmax, rows) == Occupancy.from_blocks(zmax, reversed(rows)) == occupancy


def test_a_tile_is_occupied_if_and_only_if_a_child_is():
    _, occupancy = random_occupancy(5, 0.03)
    for z in range(5):
        for x in range(2**z):
            for y in range(2**z):
                assert (TileId(z, x, y) in occupancy) == any(child in occupancy for child in children(TileId(z, x, y)))


def test_membership_agrees_with_the_grid():
    grid, occupancy = random_occupancy(4, 0.3)
    assert all((TileId(4, x, y) in occupancy) == grid[y, x] for x in range(16) for y in range(16))


@pytest.mark.parametrize("tile", [(-1, 0, 0), (5, 0, 0), (4, 16, 0), (4, 0, -1)])
def test_tiles_that_cannot_exist_are_not_occupied(tile):
    assert TileId(*tile) not in from_grid(np.ones((16, 16), dtype=bool))


def test_union_holds_the_tiles_of_both():
    one, two = random_occupancy(4, 0.1, 1), random_occupancy(4, 0.1, 2)
    assert one[1] | two[1] == from_grid(one[0] | two[0])


def test_vectorised_morton_numbers_agree_with_those_of_names():
    x, y = np.random.default_rng(0).integers(0, 2**26, (2, 200))
    numbers = morton_numbers(x, y)
    assert [int(n) for n in numbers] == [morton(int(a), int(b)) for a, b in zip(x, y, strict=True)]
    back = xy_from_morton(numbers)
    np.testing.assert_array_equal(back, (x, y))


def test_deep_levels_stay_sparse():
    occupancy = Occupancy.from_tiles(26, [(2**26 - 1, 2**26 - 1), (0, 0)])
    assert Occupancy.decode(26, occupancy.encode()) == occupancy
    assert occupancy.count() == 1 + 2 * 26
    tile = TileId(26, 2**26 - 1, 2**26 - 1)
    while tile:
        assert tile in occupancy
        tile = parent(tile)


@pytest.mark.parametrize(
    ("zmax", "text"),
    [
        (0, ""), (0, "AQ"), (0, "?!=="), (0, "é"), (0, "AQE="), (0, "Aw=="), (1, "AQ=="), (2, "AQ=="), (2, "OwQB" + "AAAA"), (2, "OwQ="),
        (0, base64.b64encode(b"\x81").decode()), (3, "OwQB"),
    ],
)  # fmt: skip
def test_what_is_no_occupancy_is_corrupt(zmax, text):
    with pytest.raises(Corrupt):
        Occupancy.decode(zmax, text)


@pytest.mark.parametrize("tiles", [[(4, 0)], [(0, 4)], [(-1, 0)]])
def test_tiles_outside_are_refused(tiles):
    with pytest.raises(BadRequest):
        Occupancy.from_tiles(2, tiles)


@pytest.mark.parametrize("zmax", range(8))
def test_part_within_blocks_holds_their_tiles(zmax):
    _, occupancy = random_occupancy(zmax, 0.3)
    root = block_levels(zmax)[0].root
    blocks = occupancy.numbers(root)[::2]
    kept = occupancy.within(blocks)
    assert set(kept.tiles(zmax)) == {tile for tile in occupancy.tiles(zmax) if morton(tile.x, tile.y) >> 2 * (zmax - root) in set(blocks.tolist())}
    assert all(kept.count_in(BlockId(root, *xy)) > 0 for xy in np.stack(xy_from_morton(blocks), axis=1).tolist())


@pytest.mark.parametrize("zmax", range(8))
def test_levels_agree_with_the_tiles_above_the_base_tiles(zmax):
    _, occupancy = random_occupancy(zmax, 0.05)
    for z in range(zmax + 1):
        above = sorted({int(number) >> 2 * (zmax - z) for number in occupancy.numbers(zmax)})
        assert occupancy.numbers(z).tolist() == above
        assert occupancy.count(z) == len(above)


def test_tiles_in_a_block_are_counted():
    _, occupancy = random_occupancy(6, 0.1)
    for x in range(8):
        for y in range(8):
            expected = sum(tile in occupancy for tile in tiles_of_block(BlockId(3, x, y), 6) if tile.z == 6)
            assert occupancy.count_in(BlockId(3, x, y)) == expected


@pytest.mark.parametrize(("some", "others"), [([], []), ([1, 5], []), ([], [2]), ([1, 5, 9], [0, 5, 7, 9, 11])])
def test_unions_of_numbers_are_sorted_and_unique(some, others):
    union = union_of(np.array(some, np.uint64), np.array(others, np.uint64))
    assert union.tolist() == sorted({*some, *others})
