"""The records of the catalogue, as plain values."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final

from map3d.catalogue.states import State
from map3d.geometry.frames import PinnedFrame, Window
from map3d.geometry.heights import Heights, find_vertical_epsg, heights_of
from map3d.geometry.views import track_id
from map3d.messages import Message
from map3d.types import BlockId, BlockKind, Box, Layer, Vec3

LOCAL_CRS_NAME = "local metres"
WINDOW = "window"
DESCRIPTION: Final = "description"
START_VIEW: Final = "start_view"
"""Keys in `RenderingRecord.options`: what the map says of itself, and the id of the view in which it opens."""
HEIGHTS_DIFFER: Final = "heights_differ"
"""Key in `SceneRecord.options` of scenes whose files do not share the height system of the scene."""
FENCES_PER_VERSION: Final = 1 << 20
"""New jobs start with this times the content version, so that after --regrid no job gets a fence that an earlier job of the same block had."""


@dataclass(frozen=True)
class SceneCrs:
    """A scene's coordinate system as the manifest states it. A local system has neither EPSG code nor WKT."""

    epsg: int | None
    wkt: str | None
    name: str
    vertical: str | None = None

    @property
    def is_local(self) -> bool:
        return self.wkt is None

    @property
    def heights(self) -> Heights:
        return heights_of(self.vertical)

    @property
    def vertical_epsg(self) -> int | None:
        return find_vertical_epsg(self.wkt) if self.heights == "geoid" else None

    @property
    def heights_text(self) -> str:
        """Returns e.g. "DHHN2016 height (EPSG:7837)"."""
        if self.vertical is None:
            return "of an unknown height system"
        return self.vertical if self.vertical_epsg is None else f"{self.vertical} (EPSG:{self.vertical_epsg})"

    @property
    def without_heights(self) -> "SceneCrs":
        """The horizontal part alone."""
        from map3d.geometry.crs import horizontal_crs, parse_crs

        wkt = None if self.wkt is None else horizontal_crs(parse_crs(self.wkt)).to_wkt("WKT2_2019")
        return replace(self, wkt=wkt, vertical=None)


@dataclass(frozen=True)
class SceneRecord:
    """`crs` and `origin` are None until `create-scene --crs` or the first asset pins them; afterwards they never change.

    `built` is the digest of everything that the last build depended on, None before the first build.
    """

    name: str
    title: str = ""
    attribution: str = ""
    crs: SceneCrs | None = None
    origin: Vec3 | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    built: str | None = None

    @property
    def stated_crs(self) -> SceneCrs | None:
        """What may be stated of `crs`: without a height system that not all files share."""
        return self.crs if self.crs is None or not self.options.get(HEIGHTS_DIFFER) else self.crs.without_heights


@dataclass(frozen=True)
class AssetRecord:
    """One imported source document. `digest` covers the imported asset, `source_digest` its source files, its options and the reader's version."""

    scene: str
    name: str
    source: str
    format: str
    digest: str
    source_digest: str
    report: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Track:
    """One pass of one view (spec/pyramid.md §8), with its own jobs, tile store and block versions. The store numbers `layers` from 0."""

    frame: PinnedFrame
    number: int
    layers: tuple[Layer, ...]

    @cached_property
    def id(self) -> str:
        return track_id(self.frame.id, self.number)


@dataclass(frozen=True)
class RenderingRecord:
    """Views, layers and resolution of a scene. `box`: the scene's local box from which the frames were pinned. All frames share size, levels and tile
    size.

    `passes`: the original layers, then the layers of each later addition; names are unique.

    `content_version`: version of the next tiles to change. `announced_version`: the last version that a manifest announced to clients, 0 before the
    first. `planning`: a plan has added or changed jobs and has not ended; after a kill, the same plan has to be made again.
    """

    name: str
    scene: str
    res_m: float
    passes: tuple[tuple[Layer, ...], ...]
    frames: tuple[PinnedFrame, ...]
    box: Box
    title: str = ""
    attribution: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    content_version: int = 1
    announced_version: int = 0
    planning: bool = False

    @property
    def layers(self) -> tuple[Layer, ...]:
        """Returns the layers of all passes."""
        return tuple(layer for layers in self.passes for layer in layers)

    @property
    def tracks(self) -> tuple[Track, ...]:
        """Returns every pass of every view; the passes of one view are consecutive."""
        return tuple(track for frame in self.frames for track in self.tracks_of(frame))

    def tracks_of(self, frame: PinnedFrame) -> tuple[Track, ...]:
        return tuple(Track(frame, number, layers) for number, layers in enumerate(self.passes))

    @property
    def tile_px(self) -> int:
        return self.frames[0].tile_px

    @property
    def zmax(self) -> int:
        return self.frames[0].zmax

    @property
    def size_m(self) -> float:
        return self.frames[0].size_m

    @property
    def window(self) -> Window | None:
        """Returns the window that the frames were pinned to instead of all of `box`; it is stored in `options`."""
        return Window(**self.options[WINDOW]) if WINDOW in self.options else None

    @property
    def description(self) -> str:
        return str(self.options.get(DESCRIPTION, ""))

    @property
    def start_view(self) -> str | None:
        """Returns the id of the view in which the map opens; None for the first one. A view that the rendering has no more does not count."""
        found = self.options.get(START_VIEW)
        return found if found is not None and self.frame(found) is not None else None

    def frame(self, view: str) -> PinnedFrame | None:
        return next((frame for frame in self.frames if frame.id == view), None)


@dataclass(frozen=True)
class PlannedJob:
    """A block that should exist. `order`: Morton number of its root tile. `parent`: the reduce block that takes its seam, None at the top.
    `key`: hash of everything that its bytes depend on. `ground`: its Hilbert index, in whose order jobs are leased; a reduce block has that of its
    first base block."""

    track: str
    block: BlockId
    kind: BlockKind
    order: int
    key: str
    parent: BlockId | None
    ground: int = 0


@dataclass(frozen=True)
class PlanCounts:
    """The number of jobs that planning added, changed or kept. A cancelled job that planning reopened counts as changed."""

    added: int = 0
    changed: int = 0
    kept: int = 0

    def __add__(self, other: "PlanCounts") -> "PlanCounts":
        return PlanCounts(self.added + other.added, self.changed + other.changed, self.kept + other.kept)


@dataclass(frozen=True)
class JobResult:
    """The result of a done job. `version`: the content version in which the block's bytes last changed; `tiles`: number of tiles of all layers;
    `base_tiles`: of one layer at level zmax; `bytes`: encoded size; `seconds`: time that the subprocess took.

    `occupied`: the base tiles with content as 64 bits, where bit n is the tile with Morton number n within the block; 0 for reduce jobs, None for
    jobs that an earlier version of map3d did.
    """

    version: int
    empty: bool
    tiles: int = 0
    base_tiles: int = 0
    bytes: int = 0
    seconds: float = 0.0
    occupied: int | None = None


@dataclass(frozen=True)
class Job:
    """The current state of a job. `attempts` failed or are running; `expiries`: number of expired leases. `leased_s` and `expires_s`: when the last
    lease began, and when the present one ends; `ended_s`: when the job was done last; all on the database's clock, None when unknown. `result` is
    None until the job was done once."""

    rendering: str
    track: str
    block: BlockId
    kind: BlockKind
    key: str
    state: State
    attempts: int
    expiries: int
    fence: int
    worker: str | None
    expires_s: float | None
    reason: Message | None
    result: JobResult | None
    ground: int = 0
    leased_s: float | None = None
    ended_s: float | None = None


@dataclass(frozen=True)
class Lease:
    """A worker's claim on a job. Every later call about the job passes `fence`; changed tiles get `content_version`. `ground`: as in `PlannedJob`."""

    rendering: str
    track: str
    block: BlockId
    kind: BlockKind
    key: str
    fence: int
    attempt: int
    worker: str
    content_version: int
    ground: int = 0
