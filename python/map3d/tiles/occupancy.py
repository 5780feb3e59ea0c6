"""Occupancy: which tiles of a pyramid have content (spec/manifest.md). A quadtree, written in breadth-first Morton order."""

import base64
import binascii
from collections.abc import Iterable
from itertools import chain
from typing import Self

import numpy as np
from numpy.typing import NDArray

from map3d.errors import BadRequest, Corrupt
from map3d.tiles.naming import BLOCK_LEVELS, morton
from map3d.types import DEEPEST_LEVEL, BlockId, TileId

Numbers = NDArray[np.uint64]
"""Sorted, unique Morton numbers of one level."""


class Occupancy:
    """The tiles with content, level by level; a tile is occupied if and only if one of its children is."""

    def __init__(self, zmax: int, base: Numbers) -> None:
        """`base`: Morton numbers of the occupied tiles of level zmax, in any order."""
        if not 0 <= zmax <= DEEPEST_LEVEL:
            raise BadRequest(f"occupancy with zmax {zmax}: must be 0 to {DEEPEST_LEVEL}")
        numbers = _unique(np.asarray(base, dtype=np.uint64))
        if len(numbers) and int(numbers[-1]) >= 4**zmax:
            raise BadRequest(f"occupancy: tile number {int(numbers[-1])} does not exist at level {zmax}")
        self._levels = _upward(zmax, numbers)

    @classmethod
    def from_tiles(cls, zmax: int, tiles: Iterable[tuple[int, int]]) -> Self:
        """Creates it from (x, y) of level zmax."""
        xy = np.array(list(tiles), dtype=np.int64).reshape(-1, 2)
        if len(xy) and (xy.min() < 0 or xy.max() >= 1 << zmax):
            raise BadRequest(f"occupancy: a column or row is not from 0 to {(1 << zmax) - 1}")
        return cls(zmax, morton_numbers(xy[:, 0], xy[:, 1]))

    @classmethod
    def decode(cls, zmax: int, text: str) -> Self:
        """Decodes the manifest's base64; raises Corrupt unless it is an occupancy of that depth."""
        bits = _bits(text)
        have = np.arange(int(bits[0]) if len(bits) else 0, dtype=np.uint64)
        used = 1
        for _ in range(zmax):
            flags = bits[used : used + 4 * len(have)]
            if len(flags) < 4 * len(have):
                raise Corrupt(f"occupancy ends after {len(bits)} bits, within a level")
            if len(have) and not flags.reshape(-1, 4).any(axis=1).all():
                raise Corrupt("occupancy has an occupied tile without an occupied child")
            used += len(flags)
            have = (np.repeat(have * np.uint64(4), 4) + np.tile(np.arange(4, dtype=np.uint64), len(have)))[flags]
        if len(bits) != (used + 7) // 8 * 8 or bits[used:].any():
            raise Corrupt(f"occupancy has {len(bits)} bits, expected {used} and zeros up to a whole byte")
        return cls(zmax, have)

    @classmethod
    def from_blocks(cls, zmax: int, blocks: Iterable[tuple[int, int, int]]) -> Self:
        """Creates it from (column, row, bits) of base blocks, with the bits of `block_bits`."""
        rows = np.array([(x, y, bits) for x, y, bits in blocks], dtype=np.uint64).reshape(-1, 3)
        down = min(BLOCK_LEVELS, zmax)
        flags = np.unpackbits(np.ascontiguousarray(rows[:, 2]).astype("<u8").view(np.uint8), bitorder="little").reshape(-1, 64)
        block, tile = np.nonzero(flags)
        return cls(zmax, (morton_numbers(rows[:, 0], rows[:, 1])[block] << np.uint64(2 * down)) + tile.astype(np.uint64))

    @property
    def zmax(self) -> int:
        return len(self._levels) - 1

    def encode(self) -> str:
        """Encodes to the manifest's base64."""
        bits = [np.array([len(self._levels[0]) > 0])]
        for above, below in zip(self._levels, self._levels[1:], strict=False):
            child = np.repeat(above * np.uint64(4), 4) + np.tile(np.arange(4, dtype=np.uint64), len(above))
            bits.append(_held(child, below))
        return base64.b64encode(np.packbits(np.concatenate(bits), bitorder="little").tobytes()).decode()

    def count(self, z: int | None = None) -> int:
        """Returns the number of occupied tiles of a level, or of all."""
        return sum(len(level) for level in self._levels) if z is None else len(self._levels[z])

    def numbers(self, z: int) -> Numbers:
        """Returns the sorted Morton numbers of the occupied tiles of level z."""
        return self._levels[z]

    def tiles(self, z: int) -> list[TileId]:
        """In Morton order."""
        x, y = xy_from_morton(self._levels[z])
        return [TileId(z, int(column), int(row)) for column, row in zip(x, y, strict=True)]

    def __contains__(self, tile: TileId) -> bool:
        if not (0 <= tile.z <= self.zmax and 0 <= tile.x < 1 << tile.z and 0 <= tile.y < 1 << tile.z):
            return False
        level = self._levels[tile.z]
        number = morton_numbers(np.array([tile.x]), np.array([tile.y]))[0]
        place = int(np.searchsorted(level, number))
        return place < len(level) and bool(level[place] == number)

    def __or__(self, other: Self) -> Self:
        """Returns the union with an occupancy of the same depth."""
        if other.zmax != self.zmax:
            raise BadRequest(f"occupancies of zmax {self.zmax} and {other.zmax} have no union")
        return type(self)(self.zmax, np.concatenate((self._levels[-1], other._levels[-1])))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Occupancy) and self.zmax == other.zmax and np.array_equal(self._levels[-1], other._levels[-1])

    def __hash__(self) -> int:
        return hash((self.zmax, self._levels[-1].tobytes()))


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


def xy_from_morton(numbers: Numbers) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    return _gather(numbers).astype(np.int64), _gather(numbers >> np.uint64(1)).astype(np.int64)


def _held(numbers: Numbers, by: Numbers) -> NDArray[np.bool_]:
    """Returns which of the numbers are among `others`, which are sorted."""
    if not len(by):
        return np.zeros(len(numbers), bool)
    found: NDArray[np.bool_] = by[np.minimum(np.searchsorted(by, numbers), len(by) - 1)] == numbers
    return found


def _unique(numbers: Numbers) -> Numbers:
    """Sorts and deduplicates, like np.unique, which would load more modules."""
    ordered = np.sort(numbers)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


def _upward(zmax: int, base: Numbers) -> list[Numbers]:
    levels = [base]
    for _ in range(zmax):
        levels.append(_unique(levels[-1] >> np.uint64(2)))
    return levels[::-1]


def _bits(text: str) -> NDArray[np.bool_]:
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise Corrupt(f"occupancy is not base64: {error}") from error
    if not data:
        raise Corrupt("occupancy has no bytes")
    return np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder="little").astype(bool)


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
