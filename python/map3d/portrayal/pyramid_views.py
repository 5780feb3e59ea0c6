"""Answers views from the tiles of a rendering when they lie on its pixel grid: same direction, same size of pixels, same scene, nothing clipped."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from map3d.catalogue import Catalogue, RenderingRecord, Workspace
from map3d.errors import Map3dError
from map3d.geometry.frames import NO_DEPTH, PinnedFrame, corners
from map3d.geometry.views import Axes, track_id, uvd_from_local
from map3d.portrayal.cameras import ViewCamera
from map3d.portrayal.selection import Selection
from map3d.tiles.decode_tile import decode_tile, layer_with, paste, with_alpha
from map3d.tiles.manifest import Manifest
from map3d.tiles.track_stores import open_track, read_manifest
from map3d.types import DEPTH_UNIT_M, Box, Layer, TileId

ALIGNED_PX: Final = 0.02
"""Greatest deviation of a view's borders from the pixel grid."""
KINDS: Final = ("color", "normal", "id", "depth")

Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class AlignedView:
    """A view as a rectangle of pixels of level z of a rendering's frame; `left`, `top` may lie outside the pyramid."""

    rendering: RenderingRecord
    frame: PinnedFrame
    z: int
    left: int
    top: int
    width_px: int
    height_px: int
    depth_zero_m: float

    def tiles(self) -> Iterator[tuple[TileId, int, int]]:
        """Yields the tiles that the view touches, each with the position of its corner in the view."""
        px, count = self.frame.tile_px, 1 << self.z
        for y in range(max(self.top // px, 0), min((self.top + self.height_px - 1) // px + 1, count)):
            for x in range(max(self.left // px, 0), min((self.left + self.width_px - 1) // px + 1, count)):
                yield TileId(self.z, x, y), x * px - self.left, y * px - self.top


class PyramidViews:
    """Finds and reads stored tiles for views of a workspace. Threads may share it."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue) -> None:
        self._workspace, self._catalogue = workspace, catalogue
        self._complete: dict[str, tuple[tuple[int, int, int], bool]] = {}

    def axes(self, scene: str) -> list[Axes]:
        """Returns the axes of all pyramids of a scene."""
        return list(dict.fromkeys(frame.axes for rendering in self._catalogue.renderings(scene) for frame in rendering.frames))

    def find(self, scene: str, camera: ViewCamera, selection: Selection, box: Box | None, kinds: Sequence[str]) -> AlignedView | None:
        """Returns the place of a view in a complete, current rendering that has all `kinds` of layers, or None."""
        if not camera.is_orthographic or not selection.is_everything or box is None or not set(kinds) <= set(KINDS):
            return None
        depths = uvd_from_local(camera.axes, corners(box))[:, 2]
        if camera.near_m > depths.min() or camera.far_m < depths.max():
            return None
        for rendering in self._catalogue.renderings(scene):
            if all(layer_with(rendering.layers, kind) is not None for kind in kinds):
                found = next((place for frame in rendering.frames if (place := _align(rendering, frame, camera)) is not None), None)
                if found is not None and self._is_current(rendering):
                    return found
        return None

    def read(self, view: AlignedView, kinds: Sequence[str]) -> Arrays | None:
        """Returns the arrays of a view; None if a tile cannot be read."""
        try:
            return self._read(view, kinds)
        except (Map3dError, OSError):
            return None

    def _is_current(self, rendering: RenderingRecord) -> bool:
        """Whether all tiles were rendered, after the scene was built last."""
        try:
            if rendering.planning or not self._is_complete(rendering):
                return False
            built = (self._workspace.scene_folder(rendering.scene) / "scene.json").stat().st_mtime_ns
            return self._workspace.manifest_path(rendering.name).stat().st_mtime_ns >= built
        except (Map3dError, OSError):
            return False

    def _is_complete(self, rendering: RenderingRecord) -> bool:
        """Whether the manifest lists all tiles; read again only after it has changed."""
        stat = self._workspace.manifest_path(rendering.name).stat()
        state = (stat.st_ino, stat.st_mtime_ns, stat.st_size)
        known = self._complete.get(rendering.name)
        if known is None or known[0] != state:
            data = read_manifest(self._workspace, rendering)
            known = (state, data is not None and Manifest.load(data, rendering.name).complete)
            self._complete[rendering.name] = known
        return known[1]

    def _read(self, view: AlignedView, kinds: Sequence[str]) -> Arrays:
        arrays = {kind: _empty(kind, view) for kind in kinds}
        places = list(view.tiles())
        for number, layers in enumerate(view.rendering.passes):
            wanted = _wanted(view, kinds, layers)
            if not wanted:
                continue
            with open_track(self._workspace, view.rendering, track_id(view.frame.id, number)) as store:
                for layer, own in wanted.items():
                    index = store.shape.layer_number(layer.name)
                    for (_, x, y), data in zip(places, store.read_tiles(index, [tile for tile, _, _ in places]), strict=True):
                        pixels = {} if data is None else decode_tile(layer, data, view.frame.tile_px)
                        for kind in own if pixels else ():
                            paste(arrays[kind], with_alpha(pixels[kind]) if kind == "color" else pixels[kind], x, y)
        if "depth" in arrays:
            arrays["depth"] = _metres(arrays["depth"], view)
        return arrays


def _align(rendering: RenderingRecord, frame: PinnedFrame, camera: ViewCamera) -> AlignedView | None:
    if camera.axes != frame.axes:
        return None
    left, right, bottom, top = camera.window
    pixel_m = (right - left) / camera.width_px
    z = round(math.log2(frame.size_m / (frame.tile_px * pixel_m)))
    if not 0 <= z <= frame.zmax:
        return None
    grid_m = frame.pixel_m(z)
    x0, x1 = ((value - frame.u0_m) / grid_m for value in (left, right))
    y0, y1 = ((frame.v0_m - value) / grid_m for value in (top, bottom))
    column, row = round(x0), round(y0)
    deviations = (x0 - column, x1 - column - camera.width_px, y0 - row, y1 - row - camera.height_px)
    if any(abs(value) > ALIGNED_PX for value in deviations):
        return None
    side = frame.tile_px << z
    inside = column >= 0 and row >= 0 and column + camera.width_px <= side and row + camera.height_px <= side
    if rendering.window is not None and not inside:
        return None
    return AlignedView(rendering, frame, z, column, row, camera.width_px, camera.height_px, camera.depth_zero_m)


def _wanted(view: AlignedView, kinds: Sequence[str], layers: Sequence[Layer]) -> dict[Layer, list[str]]:
    """Returns the layers of a pass to read, each with its kinds: a kind is read from the first layer of the rendering that has it."""
    wanted: dict[Layer, list[str]] = {}
    for kind in kinds:
        layer = layer_with(view.rendering.layers, kind)
        if layer is not None and layer in layers:
            wanted.setdefault(layer, []).append(kind)
    return wanted


def _empty(kind: str, view: AlignedView) -> NDArray[Any]:
    shape = (view.height_px, view.width_px)
    match kind:
        case "color":
            return np.zeros((*shape, 4), np.uint8)
        case "normal":
            return np.zeros((*shape, 3), np.uint8)
        case "id":
            return np.zeros(shape, np.uint32)
        case _:
            return np.full(shape, NO_DEPTH, np.uint32)


def _metres(units: NDArray[np.uint32], view: AlignedView) -> NDArray[np.float32]:
    depth = units.astype(np.float64) * DEPTH_UNIT_M + (view.frame.d0_m - view.depth_zero_m)
    return np.where(units == NO_DEPTH, np.nan, depth).astype(np.float32)
