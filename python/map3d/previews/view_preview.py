"""Renders small pictures of a scene for the choice of views and resolution, and estimates a rendering before it is created.

Runs in a limited subprocess (see preview_pool.py), so that neither can hold or harm the web server.
"""

from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from map3d import _core
from map3d.catalogue import codec
from map3d.geometry.core_frame import core_frame
from map3d.geometry.frames import NO_DEPTH, PinnedFrame, corners
from map3d.geometry.views import axes, check_angles, uvd_from_local
from map3d.renderings.cost_estimate import estimate_new
from map3d.subprocess import Handler, ReportProgress
from map3d.types import LAYERS, Box, Layer, ViewAngles

PREVIEW_PX: Final = 512
SAMPLE_S: Final = 3.0
_MARGIN: Final = 1.04
_DEPTH_ROOM_M: Final = 1_000.0
_CACHE_BYTES: Final = 256 << 20
_QUALITY: Final = 82
_PAPER: Final = np.array([236, 233, 226], np.float32)
_SUN: Final = np.array([-0.45, -0.35, 0.82], np.float32)


def open_previewer(_setup: Mapping[str, Any]) -> Handler:
    """A request has {"kind": "picture" | "estimate", "scene": folder, "built": digest} and the arguments of `picture` or `estimate`."""
    opened: dict[tuple[str, str], _core.Scene] = {}

    def scene_of(request: Mapping[str, Any]) -> _core.Scene:
        key = (request["scene"], request["built"])
        if key not in opened:
            opened.clear()
            opened[key] = _core.Scene(request["scene"], cache_bytes=_CACHE_BYTES)
        return opened[key]

    def handle(request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], Sequence[bytes]]:
        scene = scene_of(request)
        if request["kind"] == "estimate":
            return estimate_new(scene, codec.load_rendering(request["rendering"]), request["workers"], SAMPLE_S), []
        layer, view = Layer.load(request["layer"]), ViewAngles(*request["view"])
        at = request["at"]
        return {}, [picture(scene, view, layer, request["res_m"], None if at is None else (at[0], at[1]))]

    return handle


def picture(scene: _core.Scene, view: ViewAngles, layer: Layer, res_m: float | None, at: tuple[float, float] | None) -> bytes:
    """Returns a JPEG of PREVIEW_PX × PREVIEW_PX pixels: of the whole scene, or with `res_m` of a part with this resolution.

    `at`: its centre, as shares of the width and height of the picture of the whole scene; by default the middle of the content."""
    whole = overview_frame(scene.box, view)
    frame = whole if res_m is None else _detail_frame(scene, whole, res_m, at)
    buffer = scene.gbuffer(core_frame(frame.to_json((layer,))), 0, 0)
    out = BytesIO()
    with Image.fromarray(visible(layer.kind, buffer, _shade(scene, frame, layer, buffer))) as image:
        image.save(out, "JPEG", quality=_QUALITY)
    return out.getvalue()


def overview_frame(box: Box, view: ViewAngles) -> PinnedFrame:
    """Returns a square that shows the whole local box."""
    check_angles(view)
    uvd = uvd_from_local(axes(view), corners(box))
    low, high = uvd.min(axis=0), uvd.max(axis=0)
    size_m = float(max(high[0] - low[0], high[1] - low[1], 1.0)) * _MARGIN
    u0, v0 = (low[0] + high[0] - size_m) / 2, (low[1] + high[1] + size_m) / 2
    return PinnedFrame(view, float(u0), float(v0), float(low[2]) - _DEPTH_ROOM_M, size_m, PREVIEW_PX, 0)


def _detail_frame(scene: _core.Scene, whole: PinnedFrame, res_m: float, at: tuple[float, float] | None) -> PinnedFrame:
    across, down = at or _middle(scene, whole)
    size_m = res_m * PREVIEW_PX
    u, v = whole.u0_m + across * whole.size_m, whole.v0_m - down * whole.size_m
    return PinnedFrame(whole.angles, u - size_m / 2, v + size_m / 2, whole.d0_m, size_m, PREVIEW_PX, 0)


def _middle(scene: _core.Scene, whole: PinnedFrame) -> tuple[float, float]:
    """Returns the place of the pixel with content that is nearest to the middle of the content."""
    rows, columns = np.nonzero(scene.gbuffer(core_frame(whole.to_json()), 0, 0)["id"])
    if not len(rows):
        return 0.5, 0.5
    nearest = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
    return (float(columns[nearest]) + 0.5) / PREVIEW_PX, (float(rows[nearest]) + 0.5) / PREVIEW_PX


def _shade(scene: _core.Scene, frame: PinnedFrame, layer: Layer, buffer: Mapping[str, NDArray[Any]]) -> NDArray[np.float32] | None:
    """Returns the light of each pixel, (H, W, 1), for the layer color, which has none of its own."""
    if layer.kind != "color":
        return None
    normals = buffer.get("normal")
    if normals is None:
        normals = scene.gbuffer(core_frame(frame.to_json((Layer("normal", "normal", "png"),))), 0, 0)["normal"]
    light = 0.62 + 0.45 * np.clip((normals.astype(np.float32) / 32767) @ _SUN, 0, 1)
    return np.where(np.any(normals != 0, axis=-1), light, 1.0).astype(np.float32)[..., None]


def visible(kind: str, buffer: Mapping[str, NDArray[Any]], shade: NDArray[np.float32] | None) -> NDArray[np.uint8]:
    """Returns an RGB picture of a layer of a G-buffer (spec/pyramid.md §5): colours lit, ids in distinct colours, depths in grey."""
    empty = buffer["id"] == 0
    if kind in ("color", "picture"):
        return _over_paper(buffer[kind].astype(np.float32) / 65535, shade)
    values = _plain(kind, buffer, empty)
    return np.where(empty[..., None], _PAPER, values).astype(np.uint8)


def _over_paper(linear: NDArray[np.floating[Any]], shade: NDArray[np.float32] | None) -> NDArray[np.uint8]:
    color, coverage = linear[..., :3], linear[..., 3:]
    own = np.divide(color, coverage, out=np.zeros_like(color), where=coverage > 0) * (1 if shade is None else shade)
    srgb = np.where(own <= 0.0031308, own * 12.92, 1.055 * np.clip(own, 1e-9, 1) ** (1 / 2.4) - 0.055) * 255
    mixed: NDArray[np.uint8] = (np.clip(srgb, 0, 255) * coverage + _PAPER * (1 - coverage)).astype(np.uint8)
    return mixed


def _plain(kind: str, buffer: Mapping[str, NDArray[Any]], empty: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Returns (H, W, 3) values from 0 to 255, also where there is no surface."""
    if kind == "normal":
        return ((buffer["normal"].astype(np.float32) / 32767 + 1) * 127.5).astype(np.float32)
    if kind == "id":
        mixed = buffer["id"].astype(np.uint32) * np.uint32(2654435761)
        return np.stack([64 + (mixed >> shift) % 176 for shift in (8, 16, 24)], axis=-1).astype(np.float32)
    if LAYERS[kind].unit_m is not None:
        values = buffer[kind].astype(np.float64)
        none = empty | (buffer[kind] == NO_DEPTH)
        low, high = (values[~none].min(), values[~none].max()) if not none.all() else (0.0, 1.0)
        grey = 235 - 205 * np.clip((values - low) / max(high - low, 1.0), 0, 1)
    elif buffer[kind].dtype == np.uint16:
        grey = sum(((buffer[kind] >> hour) & 1).astype(np.float64) for hour in range(16)) / 16 * 255
    else:
        grey = buffer[kind].astype(np.float64)
    return np.repeat(grey[..., None], 3, axis=-1).astype(np.float32)
