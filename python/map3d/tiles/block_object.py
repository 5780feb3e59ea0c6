"""The format of a block in an object store (spec/catalogue.md, Tile store): a head with an index, then the tiles, then the seam.

| bytes | content |
|---|---|
| 4 | "M3DB" |
| 4 | format version, little-endian like all numbers of the head |
| 4 | length of the facts |
| 4 | number of tiles |
| 16 | hash of facts and index |
| | facts: JSON |
| 39 each | index: layer (2), z (1), x (4), y (4), hash (16), offset (8), length (4); big-endian, so that sorted bytes are sorted tiles |
| | tiles, ordered like the index; equal tiles once |
| | seam |

Offsets count from the end of the index. The hashes of the index cover all tiles, and the facts have the seam's.
"""

import json
import struct
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from map3d.errors import Corrupt, UnknownVersion
from map3d.tiles.tile_store import HASH_BYTES, StoredBlock, StoredTile, content_hash
from map3d.types import BlockId, TileId

MAGIC: Final = b"M3DB"
FORMAT_VERSION: Final = 1
START_BYTES: Final = 32 << 10
"""Length of the first read: the head of a block with 800 tiles."""

_HEAD: Final = struct.Struct(f"<4sIII{HASH_BYTES}s")
_NAME: Final = struct.Struct(">HBII")
_ENTRY: Final = struct.Struct(f">HBII{HASH_BYTES}sQI")


class Span(NamedTuple):
    """Where bytes are in a block object, counted from its start, and their hash."""

    start: int
    length: int
    hash: bytes


@dataclass(frozen=True)
class BlockIndex:
    """The head of a block object. `entries`: the index as stored; `body`: offset of the first tile; `size`: of the whole object."""

    block: StoredBlock
    fence: int
    seam: Span | None
    entries: bytes
    body: int
    size: int

    def find(self, layer: int, z: int, x: int, y: int) -> Span | None:
        """Returns where a tile is, None if the block does not contain it."""
        name, count = _NAME.pack(layer, z, x, y), len(self.entries) // _ENTRY.size
        place = bisect_left(range(count), name, key=self._name)
        return self._span(place) if place < count and self._name(place) == name else None

    def tiles(self, layer: int | None = None) -> Iterator[tuple[int, TileId, Span]]:
        """Yields (layer, tile, span) of all tiles or of one layer, sorted by layer, level, column and row."""
        for place in range(len(self.entries) // _ENTRY.size):
            number, z, x, y = _NAME.unpack(self._name(place))
            if layer is None or layer == number:
                yield number, TileId(z, x, y), self._span(place)

    def has_content_of(self, other: "BlockIndex") -> bool:
        """Whether tiles and seam have the same bytes."""
        own, others = (None if index.seam is None else index.seam.hash for index in (self, other))
        return self.entries == other.entries and own == others

    def _name(self, place: int) -> bytes:
        at = place * _ENTRY.size
        return self.entries[at : at + _NAME.size]

    def _span(self, place: int) -> Span:
        *_, digest, offset, length = _ENTRY.unpack_from(self.entries, place * _ENTRY.size)
        return Span(self.body + offset, length, digest)


def encode_block(block: BlockId, key: str, version: int, fence: int, tiles: Sequence[StoredTile], seam: bytes | None) -> tuple[bytes, BlockIndex]:
    """Returns the block object and its index. The bytes depend on the arguments alone, not on the order of the tiles."""
    entries, parts, offsets, end = [], [], {}, 0
    for tile in sorted(tiles, key=lambda tile: tile[:4]):
        digest = content_hash(tile.data)
        if digest not in offsets:
            offsets[digest], end = end, end + len(tile.data)
            parts.append(tile.data)
        entries.append(_ENTRY.pack(*tile[:4], digest, offsets[digest], len(tile.data)))
    facts = {
        "block": list(block),
        "key": key,
        "version": version,
        "fence": fence,
        "seam": None if seam is None else [end, len(seam), content_hash(seam).hex()],
    }
    text, index = json.dumps(facts, sort_keys=True).encode(), b"".join(entries)
    head = _HEAD.pack(MAGIC, FORMAT_VERSION, len(text), len(entries), content_hash(text + index)) + text + index
    data = b"".join([head, *parts, seam or b""])
    return data, decode_index(data, len(data), str(block))


def index_bytes(start: bytes, where: str) -> int:
    """Returns the length of head, facts and index. `start`: the first bytes of the object. Raises Corrupt, UnknownVersion."""
    if len(start) < _HEAD.size or start[:4] != MAGIC:
        raise Corrupt(f"{where}: not a block object; remove it and render again")
    _, version, text_bytes, count, _ = _HEAD.unpack_from(start)
    if version != FORMAT_VERSION:
        raise UnknownVersion(f"{where}: block object of version {version}; this map3d reads version {FORMAT_VERSION}")
    return int(_HEAD.size + text_bytes + count * _ENTRY.size)


def decode_index(start: bytes, size: int, where: str) -> BlockIndex:
    """Decodes the head from the first bytes of an object of `size` bytes. Raises Corrupt, UnknownVersion."""
    body = index_bytes(start, where)
    _, _, text_bytes, _, digest = _HEAD.unpack_from(start)
    text, entries = start[_HEAD.size : _HEAD.size + text_bytes], start[_HEAD.size + text_bytes : body]
    if len(start) < body or content_hash(text + entries) != digest:
        raise Corrupt(f"{where}: its index does not match its hash; remove it and render again")
    facts: dict[str, Any] = json.loads(text)
    seam = facts["seam"]
    span = None if seam is None else Span(body + seam[0], seam[1], bytes.fromhex(seam[2]))
    stored = StoredBlock(BlockId(*facts["block"]), facts["key"], facts["version"], len(entries) // _ENTRY.size)
    return BlockIndex(stored, facts["fence"], span, entries, body, size)


def check_object(data: bytes, where: str) -> BlockIndex:
    """Checks every byte of a block object. Raises Corrupt, UnknownVersion."""
    index = decode_index(data, len(data), where)
    spans = [span for _, _, span in index.tiles()] + ([] if index.seam is None else [index.seam])
    for span in spans:
        if content_hash(data[span.start : span.start + span.length]) != span.hash:
            raise Corrupt(f"{where}: bytes {span.start} to {span.start + span.length} do not match their hash; remove it and render again")
    if len(data) != max((span.start + span.length for span in spans), default=index.body):
        raise Corrupt(f"{where}: has {len(data)} bytes, its index ends elsewhere")
    return index
