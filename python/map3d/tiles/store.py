"""The contract of a tile store (spec/catalogue.md). One store holds the layers of one track of a rendering; every home passes the same tests."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Final, NamedTuple, Protocol, Self

from map3d.errors import BadRequest, NotFound
from map3d.tiles.naming import block_level, block_of
from map3d.types import MAX_LEVEL, BlockId, Layer, TileId

FORMAT_VERSION: Final = 1
HASH_BYTES: Final = 16


class StoredTile(NamedTuple):
    """An encoded tile; `layer` is its number in the order of the store's layers."""

    layer: int
    z: int
    x: int
    y: int
    data: bytes


@dataclass(frozen=True)
class StoreShape:
    """What a store is made for; fixed when it is created."""

    tile_px: int
    zmax: int
    layers: tuple[Layer, ...]

    def __post_init__(self) -> None:
        if not (self.layers and 0 <= self.zmax <= MAX_LEVEL and self.tile_px > 0):
            raise BadRequest(f"a tile store needs layers, zmax 0 to {MAX_LEVEL} and a tile size; got {self}")

    def number_of(self, layer: str) -> int:
        """Of a layer of this name; raises NotFound."""
        for number, known in enumerate(self.layers):
            if known.name == layer:
                return number
        raise NotFound(f"a tile store without layer {layer!r}; it has {', '.join(known.name for known in self.layers)}")


@dataclass(frozen=True)
class StoredBlock:
    """A block as it lies in the store. `version`: the content version in which its bytes last changed; `tiles`: how many it has."""

    id: BlockId
    key: str
    version: int
    tiles: int


class TileStore(Protocol):
    """Readers and writers may be in different processes; a reader sees a block wholly or not at all. Failures raise StoreError."""

    @property
    def shape(self) -> StoreShape: ...

    def put_block(self, block: BlockId, key: str, version: int, tiles: Sequence[StoredTile], seam: bytes | None) -> StoredBlock:
        """Commits a block in one step, in place of what it held before; durable on return. Raises BadRequest for tiles that are not the block's.

        Returns the block as stored: of equal tiles and seam, the version they already had is kept.
        """

    def get_tile(self, layer: int, z: int, x: int, y: int) -> bytes | None:
        """None: empty, or its block is not there yet."""

    def get_seam(self, block: BlockId) -> bytes | None: ...

    def get_block(self, block: BlockId) -> StoredBlock | None: ...

    def list_blocks(self) -> list[StoredBlock]:
        """By root level, deepest first, then Morton order."""

    def list_tiles(self, layer: int) -> Iterator[TileId]:
        """Every stored tile of a layer, by level, then column, then row."""

    def list_places(self, z: int) -> list[tuple[int, int]]:
        """Columns and rows of the stored tiles of a level, in any order: a tile has all layers."""

    def remove_block(self, block: BlockId) -> bool:
        """False: there was none."""

    def close(self) -> None: ...

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None: ...


def content_hash(data: bytes) -> bytes:
    """16 bytes; equal for equal tiles. Also the ETag of a served tile."""
    return hashlib.blake2b(data, digest_size=HASH_BYTES).digest()


def check_block(shape: StoreShape, block: BlockId, version: int, tiles: Sequence[StoredTile]) -> None:
    """Raises BadRequest unless the tiles are all of the block, each once, none of 0 bytes."""
    block_level(block.z, shape.zmax)
    if version < 1:
        raise BadRequest(f"block {block}: version {version}; versions count from 1")
    seen: set[tuple[int, int, int, int]] = set()
    for layer, z, x, y, data in tiles:
        name = f"block {block}: tile {layer}: {z}/{x}/{y}"
        if not 0 <= layer < len(shape.layers):
            raise BadRequest(f"{name}: no such layer; the store has {len(shape.layers)}")
        if block_of(TileId(z, x, y), shape.zmax) != block:
            raise BadRequest(f"{name} belongs to another block")
        if not data:
            raise BadRequest(f"{name} has no bytes; an empty tile is left out")
        if (layer, z, x, y) in seen:
            raise BadRequest(f"{name} is given twice")
        seen.add((layer, z, x, y))
