"""Small values that all parts exchange. No I/O, and no logic but their own checks."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, NamedTuple

from map3d import _core
from map3d.errors import BadName, BadRequest

Vec3 = tuple[float, float, float]
Box = tuple[Vec3, Vec3]
"""(least corner, greatest corner), metres, in the frame that the name says."""

LayerKind = str
"""A key of LAYERS."""
BlockKind = Literal["base", "reduce"]
DataEncoding = Literal["png", "tile"]
"""How a rendering stores normal, id and depth: as three PNG layers, or as one layer of data tiles."""


@dataclass(frozen=True)
class LayerArray:
    """An array of a G-buffer. `pixel`: uint8, uint16, uint32, int16x3 or uint16x4; `nothing`: each channel where there is no surface; `reduction`:
    how a parent's pixel follows from its children (spec/pyramid.md §7)."""

    pixel: str
    nothing: int
    reduction: str


@dataclass(frozen=True)
class LayerRow:
    """What all layers of a kind have in common: a row of spec/layers.json, which spec/README.md explains."""

    kind: LayerKind
    code: int
    array: LayerArray | None
    formats: tuple[str, ...]
    suns: tuple[int, int]
    radius: bool
    traced: bool
    view: bool
    unit_m: float | None
    holds: tuple[LayerKind, ...]

    @classmethod
    def load(cls, row: Mapping[str, Any]) -> "LayerRow":
        lists = {key: tuple(value) for key, value in row.items() if isinstance(value, list)}
        return cls(**{**row, **lists, "array": row["array"] and LayerArray(**row["array"])})


LAYERS: Final[Mapping[LayerKind, LayerRow]] = {row["kind"]: LayerRow.load(row) for row in json.loads(_core.LAYERS)}
"""All kinds of layers, in the order of the layers of a rendering."""
LAYER_KINDS: Final = tuple(LAYERS)
DATA_TILE_KINDS: Final = LAYERS["data"].holds
"""The kinds of pixels in a data tile (spec/data-tile.md)."""
LAYERS_BY_DATA: Final[Mapping[DataEncoding, tuple[LayerKind, ...]]] = {"png": ("color", *DATA_TILE_KINDS), "tile": ("color", "data")}
DEFAULT_DATA: Final[DataEncoding] = "tile"
DEFAULT_LAYERS: Final = LAYERS_BY_DATA[DEFAULT_DATA]
COLOR_KINDS: Final = tuple(kind for kind, row in LAYERS.items() if row.array is not None and row.array.pixel == "uint16x4")
RADIUS_KINDS: Final = tuple(kind for kind, row in LAYERS.items() if row.radius)
AO_RADIUS_M: Final = _core.AO_RADIUS_M
"""Least and greatest radius of ambient occlusion (spec/limits.json, like the other limits of the core)."""
TILE_PX: Final = _core.TILE_PX
"""Allowed sides of a tile."""
COLOR_FORMATS: Final = LAYERS["color"].formats
MEDIA_TYPES: Final = {"webp": "image/webp", "png": "image/png", "jpeg": "image/jpeg", "m3d": "application/vnd.map3d.data"}
FILE_SUFFIXES: Final = {"webp": "webp", "png": "png", "jpeg": "jpg", "m3d": "m3d"}
DEPTH_UNIT_M: Final = 2.0**-10
DEEPEST_LEVEL: Final = _core.DEEPEST_LEVEL
OBJECTS_PER_SHARD: Final = _core.OBJECTS_PER_SHARD

_NAME = re.compile(_core.NAME_PATTERN)


def check_name(name: str, what: str) -> str:
    """Returns `name` if it may name a scene, asset, rendering or layer; raises BadName."""
    if not _NAME.fullmatch(name):
        raise BadName(f"{what} name {name!r}: use 1 to 64 of a-z, 0-9, '-' and '_', beginning with a letter or digit")
    return name


class TileId(NamedTuple):
    """Level, column (grows with U), row (grows downward)."""

    z: int
    x: int
    y: int


class BlockId(NamedTuple):
    """The root tile of a block."""

    z: int
    x: int
    y: int

    def __str__(self) -> str:
        return f"{self.z}/{self.x}/{self.y}"


class ViewAngles(NamedTuple):
    """Look-at angle (counter-clockwise from north, 0 ≤ a < 360) and pitch (below the horizon, 0 < p ≤ 90), degrees."""

    look_at_deg: float
    pitch_deg: float


@dataclass(frozen=True)
class Sun:
    """A position of the sun: `azimuth_deg` clockwise from true north; `direction` towards it, a unit vector in local axes. `time`: UTC, e.g.
    2026-06-21T13:00:00Z; None for a sun given by its angles."""

    time: str | None
    azimuth_deg: float
    elevation_deg: float
    direction: Vec3


@dataclass(frozen=True)
class Layer:
    """One layer of a rendering as sent. `quality` (1..100) is for lossy colour formats, `suns` and `radius_m`, the radius of ambient
    occlusion, for the kinds whose rows say so; `small` trades encoding time for fewer bytes."""

    name: str
    kind: LayerKind
    format: str
    quality: int | None = None
    suns: tuple[Sun, ...] = ()
    radius_m: float | None = None
    small: bool = False

    def __post_init__(self) -> None:
        check_name(self.name, "layer")
        row = LAYERS[self.kind]
        if self.format not in row.formats:
            raise BadRequest(f"layer {self.name}: format {self.format!r} cannot hold {self.kind}; use {' or '.join(row.formats)}")
        least, most = row.suns
        if not least <= len(self.suns) <= most:
            expected = f"{least} to {most}" if least < most else f"{most or 'none'}"
            raise BadRequest(f"layer {self.name}: got {len(self.suns)} suns, expected {expected} for kind {self.kind}")
        if row.radius != (self.radius_m is not None):
            raise BadRequest(f"layer {self.name}: radius is {self.radius_m}; only the kinds {' and '.join(RADIUS_KINDS)} take one")
        low, high = AO_RADIUS_M
        if self.radius_m is not None and not low <= self.radius_m <= high:
            raise BadRequest(f"layer {self.name}: radius is {self.radius_m:g} m, expected {low:g} to {high:g} m")

    @classmethod
    def load(cls, value: Mapping[str, Any]) -> "Layer":
        """Returns the layer that `dataclasses.asdict` wrote, also from JSON; ignores further keys."""
        suns = tuple(Sun(sun["time"], sun["azimuth_deg"], sun["elevation_deg"], _vec3(sun["direction"])) for sun in value.get("suns", ()))
        return cls(value["name"], value["kind"], value["format"], value.get("quality"), suns, value.get("radius_m"), value.get("small", False))

    @property
    def media_type(self) -> str:
        return MEDIA_TYPES[self.format]


def _vec3(value: Sequence[float]) -> Vec3:
    x, y, z = (float(number) for number in value)
    return (x, y, z)
