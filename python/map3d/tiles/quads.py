"""Quadtree levels as groups of four bits: bit n of a group is the child with Morton number n of one occupied tile.

`bits` are (n,) uint64, one element per block: bit n is the tile with Morton number n within the block, of one level.
"""

import numpy as np
from numpy.typing import NDArray

from map3d.errors import Corrupt

Groups = NDArray[np.uint8]
"""(n,) groups of four bits, 1 to 15, in Morton order."""

_ONES = np.array([value.bit_count() for value in range(256)], np.uint8)


def count(bits: NDArray[np.unsignedinteger]) -> int:
    """Returns the number of ones."""
    return int(_ONES[np.ascontiguousarray(bits).view(np.uint8)].sum(dtype=np.int64))


def groups_of(children: NDArray[np.uint64]) -> Groups:
    """Returns the groups of the parents of sorted, unique Morton numbers."""
    if not len(children):
        return np.zeros(0, np.uint8)
    parents = children >> np.uint64(2)
    starts = np.flatnonzero(np.append(True, parents[1:] != parents[:-1]))
    groups: Groups = np.bitwise_or.reduceat(np.uint8(1) << (children & np.uint64(3)).astype(np.uint8), starts)
    return groups


def children_of(numbers: NDArray[np.uint64], groups: Groups) -> NDArray[np.uint64]:
    """Returns the Morton numbers of the occupied children of tiles."""
    is_occupied = np.unpackbits(groups[:, None], axis=1, count=4, bitorder="little").astype(bool)
    children: NDArray[np.uint64] = (numbers[:, None] * np.uint64(4) + np.arange(4, dtype=np.uint64))[is_occupied]
    return children


def groups_within(bits: NDArray[np.uint64]) -> Groups:
    """Returns the groups of the occupied tiles of the level above, block by block."""
    groups = _by_four(bits).reshape(-1)
    occupied: Groups = groups[groups != 0]
    return occupied


def fold(bits: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Returns the bits of the level above."""
    return _as_bits(np.packbits(_by_four(bits) != 0, axis=1, bitorder="little"))


def unfold(bits: NDArray[np.uint64], groups: Groups) -> NDArray[np.uint64]:
    """Returns the bits of the level below a level of at most 16 tiles per block, from the groups of its occupied tiles."""
    dense = np.zeros((len(bits), 16), np.uint8)
    dense[flags(bits)[:, :16]] = groups
    return _as_bits(dense[:, 0::2] | dense[:, 1::2] << np.uint8(4))


def flags(bits: NDArray[np.uint64]) -> NDArray[np.bool_]:
    """(n, 64) flags."""
    return np.unpackbits(_as_bytes(bits), axis=1, bitorder="little").astype(bool)


def pack(groups: Groups) -> bytes:
    """Returns a bit that says whether there are groups, then the groups; from the least significant bit, padded with zeros to whole bytes."""
    if not len(groups):
        return b"\0"
    padded = np.append(groups, np.zeros(2 - len(groups) % 2, np.uint8))
    pairs = padded[0::2] | padded[1::2] << np.uint8(4)
    carried = np.append(np.uint8(1), pairs[:-1] >> np.uint8(7))
    return (pairs << np.uint8(1) | carried).tobytes()


def unpack(data: bytes) -> tuple[bool, Groups]:
    """Returns the first bit and all groups of four bits after it, of which the last may be padding. Raises Corrupt without bytes."""
    if not data:
        raise Corrupt("occupancy has no bytes")
    packed = np.frombuffer(data, np.uint8)
    pairs = packed >> np.uint8(1) | np.append(packed[1:], np.uint8(0)) << np.uint8(7)
    groups = np.stack((pairs & np.uint8(15), pairs >> np.uint8(4)), axis=1).reshape(-1)
    return bool(packed[0] & 1), groups


def _by_four(bits: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """(n, 16) groups of four bits, also those without a one."""
    pairs = _as_bytes(bits)
    return np.stack((pairs & np.uint8(15), pairs >> np.uint8(4)), axis=2).reshape(-1, 16)


def _as_bytes(bits: NDArray[np.uint64]) -> NDArray[np.uint8]:
    return np.ascontiguousarray(bits, "<u8").view(np.uint8).reshape(-1, 8)


def _as_bits(data: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """Returns (n, up to 8) bytes as bits."""
    padded = np.zeros((len(data), 8), np.uint8)
    padded[:, : data.shape[1]] = data
    return padded.view("<u8").reshape(-1).astype(np.uint64, copy=False)
