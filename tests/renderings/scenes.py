"""A scene for planning: cubes in the plane. A block's key depends on the cubes that overlap it."""

import hashlib
import json

import numpy as np

from map3d import _core
from map3d.catalogue import RenderingRecord
from map3d.geometry.frames import pin
from map3d.tiles.naming import morton
from map3d.tiles.occupancy import morton_numbers
from map3d.types import Box, Layer, ViewAngles

LAYERS = (Layer("color", "color", "webp", 80), Layer("id", "id", "png"))


class SquareScene:
    """Content: points (u, v) as shares of the view's square, each with a name that the keys depend on."""

    def __init__(self, content: dict[tuple[float, float], str], box: Box = ((0.0, 0.0, 0.0), (100.0, 100.0, 10.0))) -> None:
        self.content, self.box = content, box

    def occupied(self, frame: _core.Frame, level: int, within: tuple[int, np.ndarray] | None = None) -> np.ndarray:
        z, blocks = (0, [[0, 0]]) if within is None else (within[0], within[1].tolist())
        mine = [(u, v) for u, v in self.content if [int(u * 2**z), int(v * 2**z)] in blocks]
        return np.array(sorted({morton(int(u * 2**level), int(v * 2**level)) for u, v in mine}), np.uint64)

    def block_keys(self, frame: _core.Frame, z: int, blocks: np.ndarray) -> list[str]:
        return [self._block_key(repr(frame), z, int(x), int(y)) for x, y in blocks]

    def _block_key(self, frame: str, z: int, x: int, y: int) -> str:
        mine = [name for (u, v), name in sorted(self.content.items()) if (int(u * 2**z), int(v * 2**z)) == (x, y)]
        return hashlib.sha256(json.dumps([frame, z, x, y, mine]).encode()).hexdigest()[:16]


class SparseScene:
    """Content in side × side blocks, `step` blocks apart; keys are cheap. `occupied` takes 8 bytes per block."""

    box: Box = ((0.0, 0.0, 0.0), (100.0, 100.0, 10.0))

    def __init__(self, side: int, step: int) -> None:
        x, y = np.meshgrid(np.arange(side), np.arange(side))
        self._numbers = np.sort(morton_numbers(x.ravel() * step, y.ravel() * step))

    def occupied(self, frame: _core.Frame, level: int, within: tuple[int, np.ndarray] | None = None) -> np.ndarray:
        return self._numbers

    def block_keys(self, frame: _core.Frame, z: int, blocks: np.ndarray) -> list[str]:
        return [f"{x:016x}{y:016x}" for x, y in blocks.tolist()]


def rendering(res_m: float = 0.02, views: tuple[ViewAngles, ...] = (ViewAngles(0, 45), ViewAngles(90, 45))) -> RenderingRecord:
    box: Box = ((0.0, 0.0, 0.0), (100.0, 100.0, 10.0))
    return RenderingRecord("r", "town", res_m, (LAYERS,), tuple(pin(box, 256, res_m, views)), box)
