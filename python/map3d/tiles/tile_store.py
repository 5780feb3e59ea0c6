"""The interface of a tile store (spec/catalogue.md). A store contains the layers of one track. All implementations pass the same tests."""

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Final, NamedTuple, Protocol, Self

from map3d.errors import BadRequest, NotFound
from map3d.tiles.naming import block_level, block_of
from map3d.types import DEEPEST_LEVEL, BlockId, Layer, TileId

FORMAT_VERSION: Final = 2
HASH_BYTES: Final = 16


class StoredTile(NamedTuple):
    """An encoded tile; `layer` is its index in the store's layers."""

    layer: int
    z: int
    x: int
    y: int
    data: bytes


@dataclass(frozen=True)
class StoreShape:
    """Fixed when the store is created."""

    tile_px: int
    zmax: int
    layers: tuple[Layer, ...]

    def __post_init__(self) -> None:
        if not (self.layers and 0 <= self.zmax <= DEEPEST_LEVEL and self.tile_px > 0):
            raise BadRequest(f"invalid tile store: expected layers, zmax 0 to {DEEPEST_LEVEL} and a tile size, got {self}")

    def layer_number(self, layer: str) -> int:
        """Returns the index of the layer. Raises NotFound."""
        for number, known in enumerate(self.layers):
            if known.name == layer:
                return number
        raise NotFound(f"no layer {layer!r} in the tile store; its layers are {', '.join(known.name for known in self.layers)}")


@dataclass(frozen=True)
class StoredBlock:
    """A block in the store. `version`: the content version in which its bytes last changed; `tiles`: number of tiles of all layers."""

    id: BlockId
    key: str
    version: int
    tiles: int


class StoreFault(NamedTuple):
    """A fault of a store: one line, and the blocks that have to be rendered again, as far as they are known."""

    text: str
    blocks: tuple[BlockId, ...] = ()


class TileStore(Protocol):
    """Readers and writers may be different processes. A reader sees either all tiles of a block or none. Failures raise StoreError."""

    @property
    def shape(self) -> StoreShape: ...

    @property
    def url(self) -> str:
        """The path or URL of the store, for messages."""

    def put_block(self, block: BlockId, key: str, version: int, tiles: Sequence[StoredTile], seam: bytes | None, *, fence: int = 0) -> StoredBlock:
        """Replaces a block in one transaction, durable on return. Raises BadRequest for tiles of other blocks, StaleFence
        when `fence` is less than that of the stored block: a worker that lost its lease does not overwrite newer tiles.

        Returns the block as stored: if tiles and seam are equal to the old ones, it keeps the old version.
        """

    def get_tile(self, layer: int, z: int, x: int, y: int) -> bytes | None:
        """Returns None if the tile is empty or its block is missing."""

    def read_tiles(self, layer: int, tiles: Iterable[TileId]) -> Iterator[bytes | None]:
        """Yields the bytes of many tiles, in the given order; faster than one by one where tiles of a block follow each other."""

    def get_seam(self, block: BlockId) -> bytes | None: ...

    def get_seams(self, blocks: Iterable[BlockId]) -> dict[BlockId, bytes]:
        """Returns the seams of those blocks that have one."""

    def get_block(self, block: BlockId) -> StoredBlock | None: ...

    def list_blocks(self) -> list[StoredBlock]:
        """Sorted by root level, deepest first, then in Morton order."""

    def list_tiles(self, layer: int) -> Iterator[TileId]:
        """Yields all stored tiles of a layer, sorted by level, column and row."""

    def list_tile_positions(self, z: int) -> list[tuple[int, int]]:
        """Returns (column, row) of the stored tiles of a level, in any order. Every tile has all layers."""

    def layer_digest(self, layer: int) -> str:
        """Returns a digest of the layer's tiles: names and bytes, without keys and versions of their blocks."""

    def remove_block(self, block: BlockId) -> bool:
        """Returns False if the block was not stored."""

    def check(self) -> list[StoreFault]:
        """Reads the whole store and returns its faults."""

    def is_current(self) -> bool:
        """Whether the store that was opened is still the one at its URL, and not removed or replaced."""

    def close(self) -> None: ...

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None: ...


def content_hash(data: bytes) -> bytes:
    """Returns 16 bytes that are equal for equal tiles. Also the ETag of a served tile."""
    return hashlib.blake2b(data, digest_size=HASH_BYTES).digest()


def check_block(shape: StoreShape, block: BlockId, version: int, tiles: Sequence[StoredTile]) -> None:
    """Raises BadRequest unless all tiles belong to the block, are unique and have content."""
    block_level(block.z, shape.zmax)
    if version < 1:
        raise BadRequest(f"block {block}: version {version} is out of range; versions start at 1")
    seen: set[tuple[int, int, int, int]] = set()
    for layer, z, x, y, data in tiles:
        name = f"block {block}: tile {layer}: {z}/{x}/{y}"
        if not 0 <= layer < len(shape.layers):
            raise BadRequest(f"{name}: no layer {layer}; the store has layers 0 to {len(shape.layers) - 1}")
        if block_of(TileId(z, x, y), shape.zmax) != block:
            raise BadRequest(f"{name} belongs to another block")
        if not data:
            raise BadRequest(f"{name} has no bytes; omit empty tiles")
        if (layer, z, x, y) in seen:
            raise BadRequest(f"{name} occurs twice")
        seen.add((layer, z, x, y))
