"""A tile store in an object store (spec/catalogue.md): one indexed object per block, written only if no other process has written it."""

import hashlib
import json
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict
from itertools import groupby, islice
from types import TracebackType
from typing import Final, Self, TypeVar

from map3d.errors import AlreadyExists, BadRequest, Corrupt, Map3dError, NotFound, ObjectChanged, StaleFence, StoreError, UnknownVersion
from map3d.object_store import check_conditional_writes, open_object_store
from map3d.object_store.folder import FolderStore
from map3d.tiles.block_object import START_BYTES, BlockIndex, Span, check_object, decode_index, encode_block, index_bytes
from map3d.tiles.naming import block_levels, block_of, morton
from map3d.tiles.tile_store import StoredBlock, StoredTile, StoreFault, StoreShape, check_block, content_hash
from map3d.types import BlockId, Layer, TileId

SHAPE_NAME: Final = "store.json"
FORMAT_VERSION: Final = 1
BLOCKS: Final = "blocks"
SUFFIX: Final = ".m3b"
CACHED_INDEXES: Final = 2048
"""Indexes in memory: 13 KB each with four layers."""
CONNECTIONS: Final = 16
BATCH: Final = 256
WRITE_ATTEMPTS: Final = 10
"""Attempts to write a block that another worker writes."""
RANGE_ATTEMPTS: Final = 4
"""Attempts to read a part of a block that is being replaced; then the whole object is read."""

_Given = TypeVar("_Given")
_Found = TypeVar("_Found")


class ObjectTileStore:
    """A `TileStore` that threads, processes and nodes may share."""

    def __init__(self, url: str, *, read_only: bool = False) -> None:
        """Opens an existing store. Raises NotFound, UnknownVersion, Corrupt, StoreError."""
        self._objects = open_object_store(url)
        self._read_only = read_only
        self._indexes: OrderedDict[BlockId, tuple[str, BlockIndex]] = OrderedDict()
        self._lock = threading.Lock()
        found = self._objects.get(SHAPE_NAME)
        if found is None:
            raise NotFound(f"{url}: no such tile store; render the rendering first")
        self._shape, self._shape_tag = _load_shape(found[0], url), found[1]

    @classmethod
    def create(cls, url: str, shape: StoreShape) -> Self:
        """Creates an empty store. Raises AlreadyExists; StoreError, also for an object store that ignores the conditions of writes."""
        objects = open_object_store(url)
        if objects.exists(SHAPE_NAME):
            raise AlreadyExists(f"{url}: the tile store already exists")
        check_conditional_writes(objects)
        value = {"version": FORMAT_VERSION, "tile_px": shape.tile_px, "zmax": shape.zmax, "layers": [asdict(layer) for layer in shape.layers]}
        try:
            objects.put(SHAPE_NAME, json.dumps(value, indent=1).encode(), if_absent=True)
        except ObjectChanged as error:
            raise AlreadyExists(f"{url}: the tile store already exists") from error
        return cls(url)

    @classmethod
    def open_or_create(cls, url: str, shape: StoreShape) -> Self:
        """Opens the store, or creates it. Raises BadRequest if an existing store has a different shape."""
        try:
            return cls.create(url, shape)
        except AlreadyExists:
            store = cls(url)
        if store.shape != shape:
            raise BadRequest(f"{url}: the store has {store.shape}, expected {shape}; use --regrid to render from scratch")
        if isinstance(store._objects, FolderStore):
            store._objects.remove_drafts()
        return store

    @property
    def shape(self) -> StoreShape:
        return self._shape

    @property
    def url(self) -> str:
        return self._objects.url

    def put_block(self, block: BlockId, key: str, version: int, tiles: Sequence[StoredTile], seam: bytes | None, *, fence: int = 0) -> StoredBlock:
        self._check_writable()
        check_block(self._shape, block, version, tiles)
        for _ in range(WRITE_ATTEMPTS):
            found = self._read_index(block)
            with suppress(ObjectChanged):
                return self._replace(found, block, key, version, tiles, seam, fence)
        raise StoreError(f"{self.url}: block {block} was replaced by others {WRITE_ATTEMPTS} times while it was written")

    def _replace(
        self,
        found: tuple[str, BlockIndex] | None,
        block: BlockId,
        key: str,
        version: int,
        tiles: Sequence[StoredTile],
        seam: bytes | None,
        fence: int,
    ) -> StoredBlock:
        """Writes the block unless its object is no longer the one that was found. Raises ObjectChanged, StaleFence."""
        data, index = encode_block(block, key, version, fence, tiles, seam)
        tag, old = found or (None, None)
        if old is not None and fence < old.fence:
            raise StaleFence(f"block {block}: fence {fence} is stale; the stored tiles have fence {old.fence}")
        if old is not None and old.block.version != version and index.has_content_of(old):
            data, index = encode_block(block, key, old.block.version, fence, tiles, seam)
        new_tag = self._objects.put(_object_name(block), data, if_absent=tag is None, if_match=tag)
        self._remember(block, new_tag, index)
        return index.block

    def remove_block(self, block: BlockId) -> bool:
        self._check_writable()
        if not self._objects.exists(_object_name(block)):
            return False
        self._objects.delete(_object_name(block))
        return True

    def get_tile(self, layer: int, z: int, x: int, y: int) -> bytes | None:
        try:
            block = block_of(TileId(z, x, y), self._shape.zmax)
        except BadRequest:
            return None
        return self._read_span(block, lambda index: index.find(layer, z, x, y)) if 0 <= layer < len(self._shape.layers) else None

    def read_tiles(self, layer: int, tiles: Iterable[TileId]) -> Iterator[bytes | None]:
        groups = (list(group) for _, group in groupby(tiles, lambda tile: block_of(tile, self._shape.zmax)))
        for found in self._map(lambda group: self._read_group(layer, group), groups, CONNECTIONS):
            yield from found

    def _read_group(self, layer: int, tiles: Sequence[TileId]) -> list[bytes | None]:
        """Reads tiles of one block with one request; one by one if they are far apart in its object, or if it is replaced meanwhile."""
        block = block_of(tiles[0], self._shape.zmax)
        found = self._current_index(block)
        spans = [None if found is None else found[1].find(layer, *tile) for tile in tiles]
        known = [span for span in spans if span is not None]
        if found is not None and len(known) > 1:
            start, end = min(span.start for span in known), max(span.start + span.length for span in known)
            if end - start <= 2 * sum(span.length for span in known):
                with suppress(ObjectChanged):
                    whole = self._objects.get_range(_object_name(block), start, end - start, if_match=found[0]) or b""
                    parts = [None if span is None else whole[span.start - start : span.start - start + span.length] for span in spans]
                    if all(span is None or part is None or content_hash(part) == span.hash for span, part in zip(spans, parts, strict=True)):
                        return parts
        return [self.get_tile(layer, *tile) for tile in tiles]

    def get_seam(self, block: BlockId) -> bytes | None:
        return self._read_span(block, lambda index: index.seam)

    def get_seams(self, blocks: Iterable[BlockId]) -> dict[BlockId, bytes]:
        chosen = list(blocks)
        found = zip(chosen, self._map(self.get_seam, chosen), strict=True)
        return {block: seam for block, seam in found if seam is not None}

    def get_block(self, block: BlockId) -> StoredBlock | None:
        found = self._current_index(block)
        return None if found is None else found[1].block

    def list_blocks(self) -> list[StoredBlock]:
        blocks = [index.block for index in self._list_indexes()]
        return sorted(blocks, key=lambda block: (-block.id.z, morton(block.id.x, block.id.y)))

    def list_tiles(self, layer: int) -> Iterator[TileId]:
        yield from sorted(tile for index in self._list_indexes() for _, tile, _ in index.tiles(layer))

    def list_tile_positions(self, z: int) -> list[tuple[int, int]]:
        roots = [level.root for level in block_levels(self._shape.zmax) if level.root <= z < level.root + level.levels]
        return [(tile.x, tile.y) for root in roots for index in self._list_indexes(root) for _, tile, _ in index.tiles(0) if tile.z == z]

    def layer_digest(self, layer: int) -> str:
        total = hashlib.sha256()
        for tile, digest in sorted((tile, span.hash) for index in self._list_indexes() for _, tile, span in index.tiles(layer)):
            total.update(b"%d/%d/%d " % tile + digest)
        return total.hexdigest()

    def check(self) -> list[StoreFault]:
        names = [name for name, _ in self._objects.list(BLOCKS)]
        return [fault for fault in self._map(self._check_object, names) if fault is not None]

    def is_current(self) -> bool:
        return self._objects.entity_tag(SHAPE_NAME) == self._shape_tag

    def close(self) -> None:
        """Forgets the cached indexes. The store stays usable."""
        with self._lock:
            self._indexes.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _check_writable(self) -> None:
        if self._read_only:
            raise BadRequest(f"{self.url}: the store is open for reading only")

    def _check_object(self, name: str) -> StoreFault | None:
        """Returns the fault of a block object, None for a sound one."""
        found, block = self._objects.get(name), _parse_object_name(name)
        blocks = () if block is None else (block,)
        try:
            index = None if found is None else check_object(found[0], name)
        except Map3dError as error:
            return StoreFault(str(error), blocks)
        if index is not None and _object_name(index.block.id) != name:
            return StoreFault(f"{name}: contains block {index.block.id}", blocks)
        return None

    def _read_span(self, block: BlockId, find: Callable[[BlockIndex], Span | None]) -> bytes | None:
        """Reads a part of a block with one request if the cached index is still right; all of a block that is replaced again and again. Raises
        Corrupt if the bytes stay different from their hash."""
        found = self._cached_index(block)
        if found is None or find(found[1]) is None:
            found = self._current_index(block)
        for _ in range(RANGE_ATTEMPTS):
            span = None if found is None else find(found[1])
            if found is None or span is None:
                return None
            with suppress(ObjectChanged):
                data = self._objects.get_range(_object_name(block), span.start, span.length, if_match=found[0])
                if data is None:
                    return None
                if content_hash(data) == span.hash:
                    return data
            found = self._read_index(block)
        return self._read_span_of_whole(block, find)

    def _read_span_of_whole(self, block: BlockId, find: Callable[[BlockIndex], Span | None]) -> bytes | None:
        """Reads a block object with one request, which no writer can come between, and returns a part of it. Raises Corrupt, UnknownVersion."""
        where = f"{self.url}/{_object_name(block)}"
        found = self._objects.get(_object_name(block))
        if found is None:
            return None
        span = find(decode_index(found[0], len(found[0]), where))
        if span is None:
            return None
        data = found[0][span.start : span.start + span.length]
        if content_hash(data) != span.hash:
            raise Corrupt(f"{where}: a part does not match its hash; remove the object and render again")
        return data

    def _cached_index(self, block: BlockId) -> tuple[str, BlockIndex] | None:
        with self._lock:
            found = self._indexes.get(block)
            if found is not None:
                self._indexes.move_to_end(block)
            return found

    def _current_index(self, block: BlockId) -> tuple[str, BlockIndex] | None:
        """Returns the cached index if the object is still the same, else reads it."""
        found = self._cached_index(block)
        if found is not None and self._objects.entity_tag(_object_name(block)) == found[0]:
            return found
        return self._read_index(block)

    def _read_index(self, block: BlockId) -> tuple[str, BlockIndex] | None:
        """Reads the entity tag and the index, or returns None if the block is missing. Raises Corrupt, UnknownVersion."""
        name, where = _object_name(block), f"{self.url}/{_object_name(block)}"
        found = self._objects.get_start(name, START_BYTES)
        if found is not None and len(found[0]) < (need := index_bytes(found[0], where)) <= found[2]:
            start, tag, size = found
            try:
                rest = self._objects.get_range(name, len(start), need - len(start), if_match=tag)
                found = None if rest is None else (start + rest, tag, size)
            except ObjectChanged:
                whole = self._objects.get(name)
                found = None if whole is None else (*whole, len(whole[0]))
        if found is None:
            self._forget(block)
            return None
        start, tag, size = found
        index = decode_index(start, size, where)
        self._remember(block, tag, index)
        return tag, index

    def _remember(self, block: BlockId, tag: str, index: BlockIndex) -> None:
        with self._lock:
            self._indexes[block] = (tag, index)
            self._indexes.move_to_end(block)
            while len(self._indexes) > CACHED_INDEXES:
                self._indexes.popitem(last=False)

    def _forget(self, block: BlockId) -> None:
        with self._lock:
            self._indexes.pop(block, None)

    def _list_indexes(self, root: int | None = None) -> Iterator[BlockIndex]:
        """Yields the indexes of all blocks, or of those rooted at level `root`. Several requests run at once."""
        names = (name for name, _ in self._objects.list(BLOCKS if root is None else f"{BLOCKS}/{root}"))
        blocks = (block for block in map(_parse_object_name, names) if block is not None)
        yield from (found[1] for found in self._map(self._read_index, blocks) if found is not None)

    def _map(self, function: Callable[[_Given], _Found], given: Iterable[_Given], batch_size: int = BATCH) -> Iterator[_Found]:
        """Like `map`, with several requests at once."""
        rest = iter(given)
        with ThreadPoolExecutor(CONNECTIONS, thread_name_prefix="objects") as pool:
            while batch := list(islice(rest, batch_size)):
                yield from pool.map(function, batch)


def _object_name(block: BlockId) -> str:
    return f"{BLOCKS}/{block.z}/{block.x}/{block.y}{SUFFIX}"


def _parse_object_name(name: str) -> BlockId | None:
    """Returns the block of an object name, None for other names."""
    parts = name.removeprefix(f"{BLOCKS}/").removesuffix(SUFFIX).split("/")
    if len(parts) != 3 or not all(part.isascii() and part.isdigit() for part in parts):
        return None
    block = BlockId(*map(int, parts))
    return block if _object_name(block) == name else None


def _load_shape(data: bytes, url: str) -> StoreShape:
    try:
        value = json.loads(data)
        if value["version"] != FORMAT_VERSION:
            raise UnknownVersion(f"{url}: tile store version {value['version']}; this map3d reads version {FORMAT_VERSION}")
        return StoreShape(int(value["tile_px"]), int(value["zmax"]), tuple(Layer.load(row) for row in value["layers"]))
    except (ValueError, KeyError, TypeError, BadRequest) as error:
        raise Corrupt(f"{url}/{SHAPE_NAME}: not a tile store: {error}") from error
