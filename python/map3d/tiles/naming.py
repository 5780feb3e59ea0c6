"""Tile and block names (spec/pyramid.md §3 and §8): parents, children, Morton order, the block of a tile."""

from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import Final, NamedTuple

from map3d.errors import BadRequest
from map3d.geometry.morton import from_morton as from_morton
from map3d.geometry.morton import morton as morton
from map3d.types import DEEPEST_LEVEL, BlockId, BlockKind, TileId

BLOCK_LEVELS: Final = 3
"""Levels between the root of a base block and zmax, and between the roots of reduce blocks."""


class BlockLevel(NamedTuple):
    """All blocks rooted at level `root`. Each contains `levels` levels of tiles, starting with the root's."""

    root: int
    levels: int
    kind: BlockKind


def check_tile(tile: TileId) -> TileId:
    """Returns `tile`. Raises BadRequest unless its numbers are possible."""
    z, x, y = tile
    if not (0 <= z <= DEEPEST_LEVEL and 0 <= x < 2**z and 0 <= y < 2**z):
        raise BadRequest(f"tile {z}/{x}/{y} is out of range; expected 0 ≤ z ≤ {DEEPEST_LEVEL} and 0 ≤ x, y < 2^z")
    return tile


def parse_tile(z: str, x: str, y: str) -> TileId | None:
    """Parses three plain ASCII numbers without signs or leading zeros. Returns None for anything else and for tiles out of range."""
    level = _parse_number(z, 2)
    column, row = _parse_number(x, 8), _parse_number(y, 8)
    if level is None or column is None or row is None or level > DEEPEST_LEVEL:
        return None
    return TileId(level, column, row) if max(column, row) < 1 << level else None


def parent(tile: TileId) -> TileId | None:
    """Returns None at level 0."""
    return TileId(tile.z - 1, tile.x // 2, tile.y // 2) if tile.z > 0 else None


def children(tile: TileId) -> tuple[TileId, TileId, TileId, TileId]:
    """Returns the top left, top right, bottom left and bottom right child."""
    z, x, y = tile.z + 1, 2 * tile.x, 2 * tile.y
    return TileId(z, x, y), TileId(z, x + 1, y), TileId(z, x, y + 1), TileId(z, x + 1, y + 1)


def ancestor(tile: TileId, z: int) -> TileId:
    """Returns the tile of level z ≤ tile.z that covers `tile`. Raises BadRequest."""
    if not 0 <= z <= tile.z:
        raise BadRequest(f"tile {tile.z}/{tile.x}/{tile.y} has no ancestor at level {z}; expected 0 to {tile.z}")
    return TileId(z, tile.x >> (tile.z - z), tile.y >> (tile.z - z))


def sort_by_morton(tiles: Iterable[TileId]) -> list[TileId]:
    """Sorts by level, then by Morton number."""
    return sorted(tiles, key=lambda tile: (tile.z, morton(tile.x, tile.y)))


@lru_cache(maxsize=64)
def block_levels(zmax: int) -> tuple[BlockLevel, ...]:
    """Returns the base blocks, then the reduce blocks up to the one rooted at level 0."""
    root = max(zmax - BLOCK_LEVELS, 0)
    levels = [BlockLevel(root, zmax - root + 1, "base")]
    while root > 0:
        above = max(root - BLOCK_LEVELS, 0)
        levels.append(BlockLevel(above, root - above, "reduce"))
        root = above
    return tuple(levels)


def block_level(root: int, zmax: int) -> BlockLevel:
    """Returns the blocks rooted at level `root`. Raises BadRequest if there are none."""
    for level in block_levels(zmax):
        if level.root == root:
            return level
    roots = ", ".join(str(level.root) for level in block_levels(zmax))
    raise BadRequest(f"no block is rooted at level {root} in a pyramid with zmax {zmax}; root levels are {roots}")


def block_of(tile: TileId, zmax: int) -> BlockId:
    """Returns the block that contains the tile. Raises BadRequest below zmax."""
    check_tile(tile)
    for level in block_levels(zmax):
        if level.root <= tile.z < level.root + level.levels:
            return BlockId(*ancestor(tile, level.root))
    raise BadRequest(f"tile {tile.z}/{tile.x}/{tile.y} is below the deepest level, {zmax}")


def tiles_of_block(block: BlockId, zmax: int) -> Iterator[TileId]:
    """Yields every possible tile of the block, by level, in Morton order."""
    check_tile(TileId(*block))
    levels = block_level(block.z, zmax).levels
    for down in range(levels):
        for number in range(4**down):
            dx, dy = from_morton(number)
            yield TileId(block.z + down, (block.x << down) + dx, (block.y << down) + dy)


def blocks_below(block: BlockId, zmax: int) -> list[BlockId]:
    """Returns the blocks whose seams a reduce block reads, in Morton order; none for a base block."""
    level = block_level(block.z, zmax)
    if level.kind == "base":
        return []
    below = range(4**level.levels)
    offsets = (from_morton(number) for number in below)
    return [BlockId(block.z + level.levels, (block.x << level.levels) + dx, (block.y << level.levels) + dy) for dx, dy in offsets]


def block_above(block: BlockId, zmax: int) -> BlockId | None:
    """Returns the reduce block that reads this block's seam; None for the block rooted at level 0."""
    block_level(block.z, zmax)
    return block_of(TileId(block.z - 1, block.x // 2, block.y // 2), zmax) if block.z > 0 else None


def _parse_number(text: str, max_digits: int) -> int | None:
    if not (0 < len(text) <= max_digits and text.isascii() and text.isdigit()) or (len(text) > 1 and text[0] == "0"):
        return None
    return int(text)
