"""Small values that travel between all parts. No I/O, no logic beyond checking themselves."""

import re
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from map3d.errors import BadName, BadRequest

Vec3 = tuple[float, float, float]
Box = tuple[Vec3, Vec3]
"""(least corner, greatest corner), metres, in the frame that the name says."""

LayerKind = Literal["color", "normal", "id", "depth"]
BlockKind = Literal["base", "reduce"]

LAYER_KINDS: Final[tuple[LayerKind, ...]] = ("color", "normal", "id", "depth")
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
class Layer:
    """One layer of a rendering as sent. `quality` is for lossy colour formats only (1..100)."""

    name: str
    kind: LayerKind
    format: str
    quality: int | None = None

    def __post_init__(self) -> None:
        check_name(self.name, "layer")
        allowed = COLOR_FORMATS if self.kind == "color" else ("png",)
        if self.format not in allowed:
            raise BadRequest(f"layer {self.name}: format {self.format!r} cannot hold {self.kind}; use {' or '.join(allowed)}")

    @property
    def media_type(self) -> str:
        return MEDIA_TYPES[self.format]
