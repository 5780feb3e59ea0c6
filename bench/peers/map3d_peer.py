"""map3d as a peer; unlike the others it encodes its tiles."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.geometry.core_frame import core_frame

from . import FrameFields
from .scene_parts import srgb_bytes_from_linear


class Map3dRenderer:
    def __init__(self, folder: Path, cache_bytes: int = 1 << 30) -> None:
        self._scene = _core.Scene(str(folder), cache_bytes)

    def draw(self, frame: FrameFields, x: int, y: int) -> list[bytes]:
        """Returns all layers of the frame, encoded."""
        buffer = self._scene.gbuffer(core_frame(frame), x, y)
        return [_core.encode_layer(layer["kind"], layer["format"], buffer[layer["kind"]], layer.get("quality", 80)) for layer in frame["layers"]]

    def centres(self, frame: FrameFields, x: int, y: int) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
        buffer = self._scene.gbuffer(core_frame(frame), x, y)
        return buffer["id"], np.where(buffer["id"] > 0, buffer["depth"] / 1024.0, np.inf)

    def picture(self, frame: FrameFields, x: int, y: int) -> NDArray[np.uint8]:
        return srgb_bytes_from_linear(self._scene.gbuffer(core_frame(frame), x, y)["color"][..., :3] / 65535.0)
