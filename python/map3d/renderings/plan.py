"""Plans the blocks of a rendering, with keys that change when their content does (spec/pyramid.md §8, spec/catalogue.md)."""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.catalogue import Catalogue, PlannedJob, RenderingRecord, Track
from map3d.errors import OutsideFrame
from map3d.geometry.core_frame import core_frame
from map3d.geometry.frames import PinnedFrame, check_content
from map3d.renderings.hilbert_indices import HilbertIndices
from map3d.tiles.naming import block_levels
from map3d.tiles.occupancy import Numbers, Occupancy, numbers_of, union_of, xy_from_morton
from map3d.types import BlockId, Box

KEY_BATCH: Final = 1 << 16
"""Base blocks whose keys are computed together; each batch visits the chunks that it meets once."""


class PlannedScene(Protocol):
    """The part of `_core.Scene` that planning uses."""

    @property
    def box(self) -> Box: ...

    def occupied(self, frame: _core.Frame, level: int, within: tuple[int, NDArray[np.uint32]] | None = None) -> NDArray[np.uint64]: ...

    def block_keys(self, frame: _core.Frame, z: int, blocks: NDArray[np.uint32]) -> list[str]: ...


class PlannedBlocks(Mapping[str, Numbers]):
    """Track → base blocks with a job. They are read when they are looked up, so that only those of one track are in memory."""

    def __init__(self, catalogue: Catalogue, record: RenderingRecord) -> None:
        self._catalogue, self._record = catalogue, record
        self._tracks = [track.id for track in record.tracks]

    def __getitem__(self, track: str) -> Numbers:
        jobs = self._catalogue.jobs(self._record.name, track)
        return numbers_of((job.block.x, job.block.y) for job in jobs if job.kind == "base")

    def __iter__(self) -> Iterator[str]:
        return iter(self._tracks)

    def __len__(self) -> int:
        return len(self._tracks)


def plan_jobs(
    scene: PlannedScene, rendering: RenderingRecord, known: Mapping[str, Numbers], progress: Callable[[int, int], None] | None = None
) -> Iterator[PlannedJob]:
    """Yields every block that has or had content, of all tracks; every block comes before the one above it. Memory does not grow with the number of
    jobs, apart from 8 bytes per base block of one view.

    `known`: track → base blocks of earlier plans, looked up once per track; `progress` counts views. Raises OutsideFrame, before the first job, when
    content has left the pinned square.
    """
    for frame in rendering.frames:
        _check_frame(scene, rendering, frame)
    return _plan_views(scene, rendering, known, progress)


def _plan_views(
    scene: PlannedScene, rendering: RenderingRecord, known: Mapping[str, Numbers], progress: Callable[[int, int], None] | None
) -> Iterator[PlannedJob]:
    ground = HilbertIndices(rendering)
    for done, frame in enumerate(rendering.frames):
        if progress is not None:
            progress(done, len(rendering.frames))
        root = block_levels(frame.zmax)[0].root
        occupied = scene.occupied(core_frame(frame.to_json()), root)
        for track in rendering.tracks_of(frame):
            earlier = known.get(track.id)
            blocks = occupied if earlier is None else union_of(occupied, earlier)
            yield from _with_reduces(track, _base_blocks(scene, track, root, blocks, ground))


def track_frame(track: Track) -> _core.Frame:
    """Returns a view's frame with the layers of the track's pass."""
    return core_frame(track.frame.to_json(track.layers))


def planned_occupancy(scene: PlannedScene, frame: PinnedFrame, within: Numbers | None = None) -> Occupancy:
    """Returns, conservatively, every tile that may have content. `within`: only in these base blocks.

    Time and memory grow with the occupied blocks, of which `KEY_BATCH` are examined at a time.
    """
    core, root = core_frame(frame.to_json()), block_levels(frame.zmax)[0].root
    blocks = scene.occupied(core, root) if within is None else within
    batches = (blocks[start : start + KEY_BATCH] for start in range(0, len(blocks), KEY_BATCH))
    parts = [Occupancy.from_numbers(frame.zmax, scene.occupied(core, frame.zmax, (root, _columns_and_rows(batch)))) for batch in batches]
    return Occupancy.union(frame.zmax, parts)


def _columns_and_rows(numbers: Numbers) -> NDArray[np.uint32]:
    """(n, 2) columns and rows."""
    return np.stack(xy_from_morton(numbers), axis=1).astype(np.uint32)


def settings_hash(track: Track) -> str:
    """Returns the hash of everything that reduce blocks depend on besides the blocks below."""
    layers = [[layer.kind, layer.format, layer.quality, layer.small] for layer in track.layers]
    return hashlib.sha256(json.dumps([layers, track.frame.tile_px, track.frame.zmax]).encode()).hexdigest()


def _check_frame(scene: PlannedScene, rendering: RenderingRecord, frame: PinnedFrame) -> None:
    try:
        check_content(frame, scene.box, rendering.window)
    except OutsideFrame as error:
        raise OutsideFrame(f"rendering {rendering.name}: {error}") from error


@dataclass(frozen=True)
class _Block:
    """`number`: Morton number; `ground`: Hilbert index."""

    number: int
    id: BlockId
    key: str
    ground: int


def _base_blocks(scene: PlannedScene, track: Track, root: int, numbers: Numbers, ground: HilbertIndices) -> Iterator[_Block]:
    """Yields the base blocks, computing the keys of `KEY_BATCH` blocks at a time."""
    frame = track_frame(track)
    for start in range(0, len(numbers), KEY_BATCH):
        batch = numbers[start : start + KEY_BATCH]
        places = _columns_and_rows(batch)
        keys = scene.block_keys(frame, root, places)
        on_ground = ground.of(track.frame, root, places).tolist()
        for number, (x, y), key, own_ground in zip(batch.tolist(), places.tolist(), keys, on_ground, strict=True):
            yield _Block(number, BlockId(root, x, y), key, own_ground)


def _with_reduces(track: Track, base: Iterable[_Block]) -> Iterator[PlannedJob]:
    """Yields the base blocks, given in Morton order, and all reduce blocks above them, each as soon as all blocks below it are known."""
    pyramid = _OpenReduces(track)
    for block in base:
        yield from pyramid.close(block.number)
        yield pyramid.add(0, block)
    yield from pyramid.close(None)


class _OpenReduces:
    """The reduce blocks of a track whose blocks below are still being collected: at most one per level, since the blocks below one reduce block are
    consecutive in Morton order. A reduce block's key hashes the keys of the blocks below."""

    def __init__(self, track: Track) -> None:
        self._track, self._settings = track.id, settings_hash(track)
        self._levels = block_levels(track.frame.zmax)
        self._open = [_OpenReduce() for _ in self._levels]

    def add(self, depth: int, block: _Block) -> PlannedJob:
        """Adds a block of `block_levels(zmax)[depth]` to the reduce block above it and returns its job."""
        level, parent = self._levels[depth], None
        if depth + 1 < len(self._levels):
            above = self._levels[depth + 1]
            up = level.root - above.root
            parent = BlockId(above.root, block.id.x >> up, block.id.y >> up)
            self._open[depth + 1].add(block.number >> 2 * up, parent, block)
        return PlannedJob(self._track, block.id, level.kind, block.number, block.key, parent, block.ground)

    def close(self, upcoming: int | None) -> Iterator[PlannedJob]:
        """Yields, from the deepest level up, the reduce blocks that are not above the base block with Morton number `upcoming`; all for None."""
        for depth in range(1, len(self._levels)):
            reduce, up = self._open[depth], self._levels[0].root - self._levels[depth].root
            if not reduce.below or (upcoming is not None and reduce.number == upcoming >> 2 * up):
                return
            below = [(block.id, block.key) for block in reduce.below]
            key = hashlib.sha256(json.dumps([self._settings, below]).encode()).hexdigest()[:32]
            closed = _Block(reduce.number, reduce.block, key, reduce.below[0].ground)
            reduce.below = []
            yield self.add(depth, closed)


_TOP: Final = BlockId(0, 0, 0)


@dataclass
class _OpenReduce:
    """`number`: Morton number; `below`: the blocks so far, none when it is closed."""

    number: int = 0
    block: BlockId = _TOP
    below: list[_Block] = field(default_factory=list)

    def add(self, number: int, block: BlockId, below: _Block) -> None:
        self.number, self.block = number, block
        self.below.append(below)
