"""map3d as a peer; unlike the others it encodes its tiles."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.geometry.core_frame import core_frame

from . import FrameFields
from .scene_parts import srgb_bytes_from_linear


def encode_tile(layers: Iterable[_core.LayerSpec], buffer: dict[str, NDArray[Any]]) -> list[bytes]:
    """Encodes the layers of a tile from its G-buffer."""
    return [
        _core.encode_data_tile(buffer["normal"], buffer["id"], buffer["depth"])
        if layer.kind == "data"
        else _core.encode_layer(layer.kind, layer.format, buffer[layer.kind], layer.quality)
        for layer in layers
    ]


class Map3dRenderer:
    def __init__(self, folder: Path, cache_bytes: int = 1 << 30) -> None:
        self._scene = _core.Scene(str(folder), cache_bytes)

    def draw(self, frame: FrameFields, x: int, y: int) -> list[bytes]:
        """Returns all layers of the frame, encoded."""
        drawn = core_frame(frame)
        return encode_tile(drawn.layers, self._scene.gbuffer(drawn, x, y))

    def centres(self, frame: FrameFields, x: int, y: int) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
        buffer = self._scene.gbuffer(core_frame(frame), x, y)
        return buffer["id"], np.where(buffer["id"] > 0, buffer["depth"] / 1024.0, np.inf)

    def picture(self, frame: FrameFields, x: int, y: int) -> NDArray[np.uint8]:
        return srgb_bytes_from_linear(self._scene.gbuffer(core_frame(frame), x, y)["color"][..., :3] / 65535.0)
