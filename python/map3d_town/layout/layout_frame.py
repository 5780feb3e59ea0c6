"""The frame of a European town's layout: main roads, river, and the warp of regular rings."""

import math
from dataclasses import dataclass, field

import numpy as np

from map3d_town.polygons_2d import Points
from map3d_town.seeds import rng


@dataclass
class LayoutFrame:
    """Warps regular rings into an irregular town.

    `roads`: angles of the main roads; `river_y`, `river_half_m`: centre line and half width of the river, before the warp. `waves`: (kx, ky,
    phase, shift in x, shift in y).
    """

    seed: int
    wanted: int
    roads: tuple[float, ...] = ()
    river_y: float = 0.0
    river_half_m: float = 0.0
    waves: list[tuple[float, float, float, float, float]] = field(default_factory=list)

    def warp(self, points: Points) -> Points:
        """Converts layout coordinates to town coordinates. The warp is smooth and does not fold."""
        p = np.asarray(points, dtype=float).reshape(-1, 2)
        out = p * np.array([1.07, 0.95])
        for kx, ky, phase, sx, sy in self.waves:
            wave = np.sin(p[:, 0] * kx + p[:, 1] * ky + phase)
            out = out + wave[:, None] * np.array([sx, sy])
        return np.asarray(out)


def make_layout_frame(seed: int, wanted: int) -> LayoutFrame:
    source = rng(seed, "frame")
    count = 4 if wanted < 120 else 5 if wanted < 2000 else 7
    turn = source.uniform(0, 2 * np.pi)
    roads = tuple(float(turn + (i + source.uniform(-0.16, 0.16)) * 2 * np.pi / count) for i in range(count))
    reach = math.sqrt(max(wanted, 10) * 640 / math.pi)
    frame = LayoutFrame(seed, wanted, roads, -max(0.55 * reach, 92.0), 9.0 if wanted < 120 else 14.0)
    for length, size in ((620.0, 12.0), (310.0, 6.0), (170.0, 2.6)):
        for _ in range(2):
            angle, phase = source.uniform(0, 2 * np.pi, 2)
            k = 2 * np.pi / length
            sx, sy = source.normal(0, size * 0.7, 2)
            frame.waves.append((float(k * np.cos(angle)), float(k * np.sin(angle)), float(phase), float(sx), float(sy)))
    return frame
