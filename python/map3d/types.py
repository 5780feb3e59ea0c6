"""Small values that travel between all parts. No I/O, no logic beyond checking themselves."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, NamedTuple

from map3d.errors import BadName, BadRequest

Vec3 = tuple[float, float, float]
Box = tuple[Vec3, Vec3]
"""(least corner, greatest corner), metres, in the frame that the name says."""

LayerKind = Literal["color", "normal", "id", "depth", "sun", "sun16", "ao", "depth2", "picture"]
BlockKind = Literal["base", "reduce"]

LAYER_KINDS: Final[tuple[LayerKind, ...]] = ("color", "normal", "id", "depth", "sun", "sun16", "ao", "depth2", "picture")
DEFAULT_LAYERS: Final[tuple[LayerKind, ...]] = ("color", "normal", "id", "depth")
COLOR_KINDS: Final = ("color", "picture")
DEPTH_KINDS: Final = ("depth", "depth2")
SUNS: Final = {"sun": (1, 1), "sun16": (1, 16), "picture": (1, 1)}
"""How many suns a layer of these kinds has, at least and at most; others have none."""
RADIUS_KINDS: Final = ("ao", "picture")
RADIUS_M: Final = (0.5, 200.0)
"""The least and the greatest radius of ambient occlusion."""
COLOR_FORMATS: Final = ("webp", "png", "jpeg")
MEDIA_TYPES: Final = {"webp": "image/webp", "png": "image/png", "jpeg": "image/jpeg"}
DEPTH_UNIT_M: Final = 2.0**-10
MAX_LEVEL: Final = 26

_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,63}")


def check_name(name: str, what: str) -> str:
    """`name` if it may name a scene, asset, rendering or layer; raises BadName."""
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
    """Where the sun stands: `azimuth_deg` clockwise from true north; `direction` towards it, a unit vector in local axes. `time`: UTC, e.g.
    2026-06-21T13:00:00Z; None when the sun was given by its angles."""

    time: str | None
    azimuth_deg: float
    elevation_deg: float
    direction: Vec3


@dataclass(frozen=True)
class Layer:
    """One layer of a rendering as sent. `quality` is for lossy colour formats only (1..100); `suns`: of sun, sun16, picture; `radius_m`: of ambient
    occlusion, in ao, picture; `small`: encoding takes its time for fewer bytes."""

    name: str
    kind: LayerKind
    format: str
    quality: int | None = None
    suns: tuple[Sun, ...] = ()
    radius_m: float | None = None
    small: bool = False

    def __post_init__(self) -> None:
        check_name(self.name, "layer")
        allowed = COLOR_FORMATS if self.kind in COLOR_KINDS else ("png",)
        if self.format not in allowed:
            raise BadRequest(f"layer {self.name}: format {self.format!r} cannot hold {self.kind}; use {' or '.join(allowed)}")
        least, most = SUNS.get(self.kind, (0, 0))
        if not least <= len(self.suns) <= most:
            raise BadRequest(f"layer {self.name}: {len(self.suns)} suns; of kind {self.kind} it has {least} to {most}")
        low, high = RADIUS_M
        if (self.kind in RADIUS_KINDS) != (self.radius_m is not None) or not low <= (self.radius_m or low) <= high:
            raise BadRequest(
                f"layer {self.name}: radius {self.radius_m} m; {' and '.join(RADIUS_KINDS)} have one of {low:g} to {high:g}, others none"
            )

    @classmethod
    def load(cls, value: Mapping[str, Any]) -> "Layer":
        """The inverse of `dataclasses.asdict`, also from JSON; what is not a layer's is left out."""
        suns = tuple(Sun(sun["time"], sun["azimuth_deg"], sun["elevation_deg"], _vec3(sun["direction"])) for sun in value.get("suns", ()))
        return cls(value["name"], value["kind"], value["format"], value.get("quality"), suns, value.get("radius_m"), value.get("small", False))

    @property
    def media_type(self) -> str:
        return MEDIA_TYPES[self.format]


def _vec3(value: Sequence[float]) -> Vec3:
    x, y, z = (float(number) for number in value)
    return (x, y, z)
