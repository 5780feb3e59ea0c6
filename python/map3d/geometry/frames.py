"""Pinned frames: the square of a view's plane that the pyramid covers; pixels, view and local coordinates (spec/pyramid.md §2–3)."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from map3d.errors import BadRequest, LimitExceeded, OutsideFrame
from map3d.geometry.views import Axes, axes, check_angles, cos_sin, dot, local_from_uvd, uvd_from_local, view_id
from map3d.types import DEEPEST_LEVEL, DEPTH_UNIT_M, TILE_PX, Box, Layer, TileId, Vec3, ViewAngles

GROWTH = 1.05
MIN_GROWTH_Z_M = 100.0
ROOM_IN_FRONT_M = 1000.0
NO_DEPTH = 0xFFFFFFFF
BOX_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
"""Indices into `corners`: the corners around each face."""


@dataclass(frozen=True)
class Window:
    """A part of the scene: squares of at least `size_m` around a ground point, local metres. Content outside is left out.

    Raises BadRequest for numbers that are not finite, or not positive.
    """

    x_m: float
    y_m: float
    size_m: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.x_m) and math.isfinite(self.y_m)):
            raise BadRequest(f"window around ({self.x_m}, {self.y_m}): expected finite coordinates")
        if not (math.isfinite(self.size_m) and self.size_m > 0):
            raise BadRequest(f"window: size is {self.size_m} m, expected a positive number of metres")


@dataclass(frozen=True)
class PinnedFrame:
    """The square [u0, u0 + size] × [v0 − size, v0] of a view's plane, and the depth d0 of stored depth 0; metres. It never moves.

    A `_core.Frame` is a pinned frame with the layers of a pass.
    """

    angles: ViewAngles
    u0_m: float
    v0_m: float
    d0_m: float
    size_m: float
    tile_px: int
    zmax: int

    @property
    def id(self) -> str:
        return view_id(self.angles)

    @cached_property
    def axes(self) -> Axes:
        return axes(self.angles)

    def pixel_m(self, z: int) -> float:
        """Returns the side of a pixel of level z."""
        return self.size_m / (self.tile_px * 2.0**z)

    def uv_from_pixel(self, tile: TileId, i: ArrayLike, j: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns (U, V) of the centres of pixels (i, j) of a tile; i, j may be arrays, and real numbers: i + ½ is the pixel's right edge."""
        pixel_m = self.pixel_m(tile.z)
        u = self.u0_m + (tile.x * self.tile_px + np.asarray(i, dtype=np.float64) + 0.5) * pixel_m
        v = self.v0_m - (tile.y * self.tile_px + np.asarray(j, dtype=np.float64) + 0.5) * pixel_m
        return u, v

    def level_pixel_from_uv(self, z: int, u: ArrayLike, v: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns real pixel coordinates of level z from its top left corner: [k, k + 1) is pixel k of the whole level."""
        pixel_m = self.pixel_m(z)
        return (np.asarray(u, dtype=np.float64) - self.u0_m) / pixel_m, (self.v0_m - np.asarray(v, dtype=np.float64)) / pixel_m

    def pixel_from_uv(self, z: int, u: float, v: float) -> tuple[TileId, int, int]:
        """Returns the tile of level z and its pixel (i, j) that hold (U, V); raises OutsideFrame beyond the pinned square."""
        px, py = self.level_pixel_from_uv(z, u, v)
        column, row = math.floor(px), math.floor(py)
        side = self.tile_px * 2**z
        if not (0 <= column < side and 0 <= row < side):
            raise OutsideFrame(f"view {self.id}: U {u:.3f}, V {v:.3f} m is outside the pinned square of side {self.size_m:g} m")
        return TileId(z, column // self.tile_px, row // self.tile_px), column % self.tile_px, row % self.tile_px

    def local_from_pixel(self, tile: TileId, i: ArrayLike, j: ArrayLike, depth: ArrayLike) -> NDArray[np.float64]:
        """Returns (..., 3) local positions of pixels (i, j) with stored depths (units of 2^-10 m from D0); NaN for nothing."""
        u, v = self.uv_from_pixel(tile, i, j)
        units = np.asarray(depth, dtype=np.float64)
        d = np.where(units == NO_DEPTH, np.nan, self.d0_m + units * DEPTH_UNIT_M)
        return local_from_uvd(self.axes, np.stack(np.broadcast_arrays(u, v, d), axis=-1))

    def level_pixel_from_local(self, z: int, local: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Returns (px, py) as `level_pixel_from_uv` does, and the real depth from D0 in units of 2^-10 m, of (..., 3) local positions."""
        uvd = uvd_from_local(self.axes, local)
        px, py = self.level_pixel_from_uv(z, uvd[..., 0], uvd[..., 1])
        return px, py, (uvd[..., 2] - self.d0_m) / DEPTH_UNIT_M

    def check_holds(self, box: Box) -> None:
        """Raises OutsideFrame unless the local box is inside the square and all its depths can be stored."""
        uvd = uvd_from_local(self.axes, corners(box))
        low, high = uvd.min(axis=0), uvd.max(axis=0)
        inside = low[0] >= self.u0_m and high[0] <= self.u0_m + self.size_m and low[1] >= self.v0_m - self.size_m and high[1] <= self.v0_m
        if not inside:
            raise self._outside(box, "content leaves the pinned square")
        if not self._holds_depths(uvd):
            raise self._outside(box, "content has depths that cannot be stored")

    def check_window(self, box: Box) -> None:
        """As `check_holds`, for the part of the box inside the square only. Raises BadRequest when no part is."""
        uvd = self.clipped(box)
        if not len(uvd):
            raise BadRequest(f"view {self.id}: the window of {self.size_m:g} m does not meet the scene, whose local box is {box[0]} to {box[1]}")
        if not self._holds_depths(uvd):
            raise self._outside(box, "content inside the window has depths that cannot be stored")

    def clipped(self, box: Box) -> NDArray[np.float64]:
        """Returns (n, 3) UVD corners of the part of a box that projects into the square; none when nothing does."""
        points = uvd_from_local(self.axes, corners(box))
        left, top = self.u0_m, self.v0_m
        sides = ((0, 1.0, left), (0, -1.0, -left - self.size_m), (1, -1.0, -top), (1, 1.0, top - self.size_m))
        found = []
        for face in BOX_FACES:
            polygon = points[list(face)]
            for axis, sign, least in sides:
                polygon = _cut(polygon, sign * polygon[:, axis] - least)
            found.append(polygon)
        return np.concatenate(found)

    def _holds_depths(self, uvd: NDArray[np.float64]) -> bool:
        return bool(uvd[:, 2].min() >= self.d0_m and (uvd[:, 2].max() - self.d0_m) / DEPTH_UNIT_M < NO_DEPTH)

    def _outside(self, box: Box, what: str) -> OutsideFrame:
        return OutsideFrame(
            f"view {self.id}: {what}; the scene's local box is {box[0]} to {box[1]}, the side of the square {self.size_m:g} m; "
            "run map3d create-rendering with --regrid to pin new frames and render everything again"
        )

    def to_json(self, layers: Sequence[Layer] = ()) -> dict[str, Any]:
        """Returns the fields of a `_core.Frame`, as plain values; `core_frame` reads them back."""
        return {
            "look_at_deg": self.angles.look_at_deg,
            "pitch_deg": self.angles.pitch_deg,
            "u0_m": self.u0_m,
            "v0_m": self.v0_m,
            "d0_m": self.d0_m,
            "size_m": self.size_m,
            "tile_px": self.tile_px,
            "zmax": self.zmax,
            "layers": [_layer_json(layer) for layer in layers],
        }


def pin(box: Box, tile_px: int, res_m: float, views: Iterable[ViewAngles], window: Window | None = None) -> list[PinnedFrame]:
    """Returns frames for a scene's local box, one per view, all of one size; raises BadRequest, LimitExceeded.

    `res_m` is the side of a pixel of the deepest level.
    """
    angles = [check_angles(view) for view in views]
    _check_request(box, tile_px, res_m, angles)
    extent_m = _extent(_grown(box)[1], angles) if window is None else window.size_m
    zmax = _least_level(extent_m, tile_px * res_m)
    frames = [_frame(box, view, tile_px * res_m * 2.0**zmax, tile_px, zmax, window) for view in angles]
    for frame in frames if window is not None else ():
        frame.check_window(box)
    return frames


def pin_into(frame: PinnedFrame, box: Box, angles: ViewAngles, window: Window | None = None) -> PinnedFrame:
    """Returns the frame of a view that joins a rendering, with its size, levels and tile size. `box`, `window`: those of the rendering's creation."""
    added = _frame(box, check_angles(angles), frame.size_m, frame.tile_px, frame.zmax, window)
    check_content(added, box, window)
    return added


def check_content(frame: PinnedFrame, box: Box, window: Window | None) -> None:
    """Raises OutsideFrame when the frame cannot hold the scene's content, or the part of it inside a window."""
    if window is None:
        frame.check_holds(box)
    else:
        frame.check_window(box)


def corners(box: Box) -> NDArray[np.float64]:
    """Returns (8, 3) corners."""
    lo, hi = box
    return np.array([(x, y, z) for x in (lo[0], hi[0]) for y in (lo[1], hi[1]) for z in (lo[2], hi[2])], dtype=np.float64)


def _cut(polygon: NDArray[np.float64], inside: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the part of a convex polygon where `inside`, a linear function given at its corners, is not negative."""
    out = []
    for k in range(len(polygon)):
        j = (k + 1) % len(polygon)
        if inside[k] >= 0:
            out.append(polygon[k])
        if (inside[k] >= 0) != (inside[j] >= 0):
            out.append(polygon[k] + (polygon[j] - polygon[k]) * (inside[k] / (inside[k] - inside[j])))
    return np.array(out).reshape(-1, 3)


def _frame(box: Box, angles: ViewAngles, size_m: float, tile_px: int, zmax: int, window: Window | None) -> PinnedFrame:
    centre, half = _grown(box)
    middle = centre if window is None else (window.x_m, window.y_m, centre[2])
    right, up, forward = axes(angles)
    half_diagonal = math.sqrt(half[0] ** 2 + half[1] ** 2 + half[2] ** 2)
    return PinnedFrame(
        angles=angles,
        u0_m=dot(right, middle) - size_m / 2,
        v0_m=dot(up, middle) + size_m / 2,
        d0_m=dot(forward, centre) - half_diagonal - ROOM_IN_FRONT_M,
        size_m=size_m,
        tile_px=tile_px,
        zmax=zmax,
    )


def _grown(box: Box) -> tuple[Vec3, Vec3]:
    """Returns the centre and the half extents of the grown box."""
    lo, hi = box
    x, y, z = ((high - low) / 2 * GROWTH for low, high in zip(lo, hi, strict=True))
    centre = ((lo[0] + hi[0]) / 2, (lo[1] + hi[1]) / 2, (lo[2] + hi[2]) / 2)
    return centre, (x, y, max(z, (hi[2] - lo[2]) / 2 + MIN_GROWTH_Z_M))


def _extent(half: Vec3, views: Sequence[ViewAngles]) -> float:
    """Returns the largest extent of the projected grown box over all look-at angles and the given pitches."""
    flat = math.hypot(half[0], half[1])
    extents = [2 * flat]
    for view in views:
        cos_p, sin_p = cos_sin(view.pitch_deg)
        extents.append(2 * (sin_p * flat + cos_p * half[2]))
    return max(extents)


def _least_level(extent_m: float, tile_m: float) -> int:
    for z in range(DEEPEST_LEVEL + 1):
        if tile_m * 2.0**z >= extent_m:
            return z
    raise LimitExceeded(
        f"a square of {extent_m:g} m at tiles of {tile_m:g} m needs a level beyond {DEEPEST_LEVEL}, the deepest; choose a coarser resolution"
    )


def _check_request(box: Box, tile_px: int, res_m: float, angles: Sequence[ViewAngles]) -> None:
    if not angles:
        raise BadRequest("a rendering needs at least one view")
    if len(set(angles)) != len(angles):
        raise BadRequest("a view is given twice")
    if tile_px not in TILE_PX:
        raise BadRequest(f"tile size is {tile_px} px, expected {' or '.join(map(str, TILE_PX))}")
    if not (math.isfinite(res_m) and res_m > 0):
        raise BadRequest(f"resolution is {res_m} m, expected a positive number of metres per pixel")
    if not all(math.isfinite(low) and math.isfinite(high) and low <= high for low, high in zip(*box, strict=True)):
        raise BadRequest(f"box {box[0]} to {box[1]}: not a box; does the scene have content?")


def _layer_json(layer: Layer) -> dict[str, Any]:
    row: dict[str, Any] = {"kind": layer.kind, "format": layer.format}
    if layer.quality is not None:
        row["quality"] = layer.quality
    if layer.small:
        row["small"] = True
    if layer.suns:
        row["suns"] = [list(sun.direction) for sun in layer.suns]
    if layer.radius_m is not None:
        row["radius_m"] = layer.radius_m
    return row
