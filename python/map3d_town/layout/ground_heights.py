"""Ground heights as a smooth function of town coordinates."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from map3d_town.seeds import rng

DAM_HALF_M = 6.6
"""Half the width of the dam that carries a road over the river, slopes included."""
WAVES = ((900.0, 5.0), (420.0, 2.2), (190.0, 0.8), (75.0, 0.16))


@dataclass(frozen=True)
class Ground:
    """Gently rolling ground around `level_m`, flatter in the centre, with an optional river bed.

    `waves`: (kx, ky, phase, amplitude); `river`: centre line from west to east; `crossings`: (x, y, unit x, unit y) of roads on dams.
    """

    level_m: float
    waves: tuple[tuple[float, float, float, float], ...]
    river: tuple[tuple[float, float], ...] = ()
    river_half_m: float = 0.0
    crossings: tuple[tuple[float, float, float, float], ...] = ()

    def height(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Returns heights in metres at points (x, y) of any shapes that broadcast."""
        px, py = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        total = np.zeros(px.shape)
        for kx, ky, phase, size in self.waves:
            total += size * np.sin(kx * px + ky * py + phase)
        calm = 0.35 + 0.65 * np.clip(np.hypot(px, py) / 900.0, 0, 1)
        total = self.level_m + total * calm
        if self.river:
            bank = np.clip((self.river_half_m + 7.0 - self.river_distance(px, py)) / 7.0, 0, 1)
            total = total - 2.2 * bank * bank * (3 - 2 * bank) * self.open_water(px, py)
        return np.asarray(total)

    def open_water(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns 0 on the dam of a road, 1 elsewhere, smooth in between."""
        free = np.ones(x.shape)
        for cx, cy, ux, uy in self.crossings:
            aside, ahead = np.abs((x - cx) * uy - (y - cy) * ux), np.abs((x - cx) * ux + (y - cy) * uy)
            free = np.where(ahead < 90, np.minimum(free, np.clip((aside - DAM_HALF_M + 1.6) / 1.5, 0, 1)), free)
        return np.asarray(free)

    @cached_property
    def _middle(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """The river's centre line: x, y, and dy/dx."""
        east, north = np.array(self.river).T
        return east, north, np.gradient(north, east)

    def river_distance(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns the approximate distance to the river's centre line."""
        east, north, rise = self._middle
        middle, slope = np.interp(x, east, north), np.interp(x, east, rise)
        return np.asarray(np.abs(y - middle) / np.hypot(1.0, slope))


def make_ground(
    seed: int,
    level_m: float,
    river: tuple[tuple[float, float], ...] = (),
    half_m: float = 0.0,
    crossings: tuple[tuple[float, float, float, float], ...] = (),
) -> Ground:
    """Returns the random ground of a town."""
    source = rng(seed, "ground")
    waves = []
    for length, size in WAVES:
        for _ in range(2):
            angle, phase = source.uniform(0, 2 * np.pi, 2)
            k = 2 * np.pi / (length * source.uniform(0.8, 1.25))
            waves.append((float(k * np.cos(angle)), float(k * np.sin(angle)), float(phase), size / 2))
    return Ground(level_m, tuple(waves), river, half_m, crossings)
