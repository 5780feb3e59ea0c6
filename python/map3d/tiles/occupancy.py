"""Occupancy: which tiles of a pyramid have content (spec/manifest.md). A quadtree, written in breadth-first Morton order.

In memory it takes 16 bytes per base block with content: the block's Morton number, and 64 bits for its base tiles.
"""

import base64
import binascii
from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import chain
from typing import Self

import numpy as np
from numpy.typing import NDArray

from map3d.errors import BadRequest, Corrupt
from map3d.tiles import quads
from map3d.tiles.naming import BLOCK_LEVELS, morton
from map3d.types import DEEPEST_LEVEL, BlockId, TileId

Numbers = NDArray[np.uint64]
"""Sorted, unique Morton numbers of one level."""


class Occupancy:
    """The tiles with content, level by level; a tile is occupied if and only if one of its children is."""

    def __init__(self, zmax: int, blocks: NDArray[np.uint64], bits: NDArray[np.uint64]) -> None:
        """`blocks`: Morton numbers of base blocks, in any order; `bits`: those of `block_bits` of each, combined where a block comes twice."""
        if not 0 <= zmax <= DEEPEST_LEVEL:
            raise BadRequest(f"occupancy with zmax {zmax}: must be 0 to {DEEPEST_LEVEL}")
        self._zmax, self._root = zmax, _root(zmax)
        self._blocks, self._bits = _combine(blocks, bits)
        if len(self._blocks) and int(self._blocks[-1]) >= 4**self._root:
            raise BadRequest(f"occupancy: block number {int(self._blocks[-1])} does not exist at level {self._root}")

    @classmethod
    def from_numbers(cls, zmax: int, base: NDArray[np.uint64]) -> Self:
        """Creates it from Morton numbers of tiles of level zmax, in any order."""
        numbers, within = np.asarray(base, dtype=np.uint64), np.uint64(2 * (zmax - _root(zmax)))
        tiles = numbers & ((np.uint64(1) << within) - np.uint64(1))
        return cls(zmax, numbers >> within, np.uint64(1) << tiles)

    @classmethod
    def from_tiles(cls, zmax: int, tiles: Iterable[tuple[int, int]]) -> Self:
        """Creates it from (x, y) of level zmax."""
        xy = np.array(list(tiles), dtype=np.int64).reshape(-1, 2)
        if len(xy) and (xy.min() < 0 or xy.max() >= 1 << zmax):
            raise BadRequest(f"occupancy: a column or row is not from 0 to {(1 << zmax) - 1}")
        return cls.from_numbers(zmax, morton_numbers(xy[:, 0], xy[:, 1]))

    @classmethod
    def from_blocks(cls, zmax: int, blocks: Iterable[tuple[int, int, int]]) -> Self:
        """Creates it from (column, row, bits) of base blocks, with the bits of `block_bits`, in 24 bytes per block while it reads them."""
        rows = np.fromiter(chain.from_iterable(blocks), np.uint64).reshape(-1, 3)
        return cls(zmax, morton_numbers(rows[:, 0], rows[:, 1]), rows[:, 2])

    @classmethod
    def decode(cls, zmax: int, text: str) -> Self:
        """Decodes the manifest's base64; raises Corrupt unless it is an occupancy of that depth."""
        is_occupied, groups = quads.unpack(_from_base64(text))
        levels = _split_levels(groups, zmax, int(is_occupied))
        blocks = np.zeros(int(is_occupied), np.uint64)
        for own in levels[: _root(zmax)]:
            blocks = quads.children_of(blocks, own)
        bits = np.ones(len(blocks), np.uint64)
        for own in levels[_root(zmax) :]:
            bits = quads.unfold(bits, own)
        return cls(zmax, blocks, bits)

    @classmethod
    def union(cls, zmax: int, parts: Sequence[Self]) -> Self:
        """Returns all tiles of occupancies of this depth; raises BadRequest for another depth."""
        if wrong := [part._zmax for part in parts if part._zmax != zmax]:
            raise BadRequest(f"occupancies of zmax {zmax} and {wrong[0]} have no union")
        none = np.zeros(0, np.uint64)
        return cls(zmax, np.concatenate([none, *(part._blocks for part in parts)]), np.concatenate([none, *(part._bits for part in parts)]))

    @property
    def zmax(self) -> int:
        return self._zmax

    def encode(self) -> str:
        """Encodes to the manifest's base64."""
        above = [quads.groups_of(below) for below in self._above[1:]]
        within = [quads.groups_within(bits) for bits in self._within[1:]]
        if self._zmax == 0:
            return base64.b64encode(bytes([len(self._blocks)])).decode()
        return base64.b64encode(quads.pack(np.concatenate((*above, *within)))).decode()

    def count(self, z: int | None = None) -> int:
        """Returns the number of occupied tiles of a level, or of all."""
        if z is None:
            return sum(self.count(level) for level in range(self._zmax + 1))
        return len(self._above[z]) if z <= self._root else quads.count(self._within[z - self._root])

    def count_in(self, block: BlockId) -> int:
        """Returns the number of occupied tiles of level zmax in a base block."""
        number = np.uint64(morton(block.x, block.y))
        place = int(np.searchsorted(self._blocks, number))
        return int(self._bits[place]).bit_count() if place < len(self._blocks) and self._blocks[place] == number else 0

    def numbers(self, z: int) -> Numbers:
        """Returns the sorted Morton numbers of the occupied tiles of level z."""
        if z <= self._root:
            return self._above[z]
        down = z - self._root
        block, tile = np.nonzero(quads.flags(self._within[down]))
        return (self._blocks[block] << np.uint64(2 * down)) + tile.astype(np.uint64)

    def tiles(self, z: int) -> list[TileId]:
        """In Morton order."""
        x, y = xy_from_morton(self.numbers(z))
        return [TileId(z, int(column), int(row)) for column, row in zip(x, y, strict=True)]

    def within(self, blocks: Numbers) -> Self:
        """Returns the part in these base blocks."""
        kept = _is_among(self._blocks, blocks)
        return type(self)(self._zmax, self._blocks[kept], self._bits[kept])

    def __contains__(self, tile: TileId) -> bool:
        if not (0 <= tile.z <= self._zmax and 0 <= tile.x < 1 << tile.z and 0 <= tile.y < 1 << tile.z):
            return False
        down = max(tile.z - self._root, 0)
        number = morton(tile.x, tile.y)
        level, wanted = self._above[min(tile.z, self._root)], np.uint64(number >> 2 * down)
        place = int(np.searchsorted(level, wanted))
        if place == len(level) or level[place] != wanted:
            return False
        return bool(int(self._within[down][place]) >> (number & (1 << 2 * down) - 1) & 1) if down else True

    def __or__(self, other: Self) -> Self:
        """Returns the union with an occupancy of the same depth."""
        return self.union(self._zmax, (self, other))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Occupancy) or self._zmax != other._zmax:
            return False
        return np.array_equal(self._blocks, other._blocks) and np.array_equal(self._bits, other._bits)

    def __hash__(self) -> int:
        return hash((self._zmax, self._blocks.tobytes(), self._bits.tobytes()))

    @cached_property
    def _above(self) -> list[Numbers]:
        """Morton numbers of levels 0 to that of the base blocks."""
        levels = [self._blocks]
        for _ in range(self._root):
            levels.append(_unique(levels[-1] >> np.uint64(2)))
        return levels[::-1]

    @cached_property
    def _within(self) -> list[NDArray[np.uint64]]:
        """Bits of the blocks, of the levels from their roots to zmax."""
        levels = [self._bits]
        for _ in range(self._zmax - self._root):
            levels.append(quads.fold(levels[-1]))
        return levels[::-1]


def block_bits(block: BlockId, zmax: int, tiles: Iterable[TileId]) -> int:
    """Returns those of the tiles that are base tiles of the block as 64 bits: bit n is the tile with Morton number n within the block."""
    bits, down = 0, zmax - block.z
    for tile in tiles:
        if tile.z == zmax:
            bits |= 1 << morton(tile.x - (block.x << down), tile.y - (block.y << down))
    return bits


def morton_numbers(x: NDArray[np.integer], y: NDArray[np.integer]) -> Numbers:
    """Returns the (n,) Morton numbers of columns and rows."""
    return _spread(x.astype(np.uint64)) | _spread(y.astype(np.uint64)) << np.uint64(1)


def numbers_of(places: Iterable[tuple[int, int]]) -> Numbers:
    """Returns the sorted, unique Morton numbers of (x, y), in 8 bytes per place while it reads them."""
    flat = np.fromiter(chain.from_iterable(places), np.uint32).reshape(-1, 2)
    return _unique(morton_numbers(flat[:, 0], flat[:, 1]))


def union_of(some: Numbers, others: Numbers) -> Numbers:
    return _unique(np.concatenate((some, others))) if len(some) and len(others) else some if len(some) else others


def xy_from_morton(numbers: Numbers) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    return _gather(numbers).astype(np.int64), _gather(numbers >> np.uint64(1)).astype(np.int64)


def _root(zmax: int) -> int:
    """Returns the level of the base blocks' roots."""
    return max(zmax - BLOCK_LEVELS, 0)


def _combine(blocks: NDArray[np.uint64], bits: NDArray[np.uint64]) -> tuple[Numbers, NDArray[np.uint64]]:
    """Sorts the blocks, combines the bits of equal ones, and leaves out blocks without tiles."""
    if len(blocks) and not (blocks[1:] > blocks[:-1]).all():
        order = np.argsort(blocks, kind="stable")
        blocks, bits = blocks[order], bits[order]
        starts = np.flatnonzero(np.append(True, blocks[1:] != blocks[:-1]))
        blocks, bits = blocks[starts], np.bitwise_or.reduceat(bits, starts)
    has_tiles = bits != 0
    return (blocks, bits) if has_tiles.all() else (blocks[has_tiles], bits[has_tiles])


def _is_among(numbers: Numbers, others: Numbers) -> NDArray[np.bool_]:
    """Returns which of the numbers are among `others`, which are sorted."""
    if not len(others):
        return np.zeros(len(numbers), bool)
    found: NDArray[np.bool_] = others[np.minimum(np.searchsorted(others, numbers), len(others) - 1)] == numbers
    return found


def _split_levels(groups: quads.Groups, zmax: int, tiles: int) -> list[quads.Groups]:
    """Returns the groups of each level above zmax. `tiles`: occupied tiles of level 0. Raises Corrupt when groups are missing or left over."""
    levels, used = [], 0
    for level in range(zmax):
        own = groups[used : used + tiles]
        if len(own) < tiles:
            raise Corrupt(f"occupancy ends within level {level}, after {len(own)} of {tiles} tiles")
        if not own.all():
            raise Corrupt(f"occupancy has an occupied tile of level {level} without an occupied child")
        levels.append(own)
        used, tiles = used + tiles, quads.count(own)
    if groups[used:].any() or len(groups) - used != 2 - used % 2:
        raise Corrupt(f"occupancy has {len(groups)} groups of four bits, expected {used} and zeros up to a whole byte")
    return levels


def _unique(numbers: Numbers) -> Numbers:
    """Sorts and deduplicates, like np.unique, which would load more modules."""
    ordered = np.sort(numbers)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


def _from_base64(text: str) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise Corrupt(f"occupancy is not base64: {error}") from error


_STEPS = ((16, 0x0000FFFF0000FFFF), (8, 0x00FF00FF00FF00FF), (4, 0x0F0F0F0F0F0F0F0F), (2, 0x3333333333333333), (1, 0x5555555555555555))


def _spread(value: Numbers) -> Numbers:
    for shift, mask in _STEPS:
        value = (value | value << np.uint64(shift)) & np.uint64(mask)
    return value


def _gather(value: Numbers) -> Numbers:
    value = value & np.uint64(0x5555555555555555)
    for shift, mask in ((1, 0x3333333333333333), (2, 0x0F0F0F0F0F0F0F0F), (4, 0x00FF00FF00FF00FF), (8, 0x0000FFFF0000FFFF), (16, 0xFFFFFFFF)):
        value = (value | value >> np.uint64(shift)) & np.uint64(mask)
    return value
