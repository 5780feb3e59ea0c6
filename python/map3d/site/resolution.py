"""Chooses a resolution: as fine as the surfaces, and coarse enough that rendering takes minutes."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.geometry.core_frame import core_frame
from map3d.geometry.frames import pin
from map3d.types import ViewAngles

RESOLUTIONS_M: Final = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
MAX_BASE_TILES: Final = 30_000
"""For all views together: some minutes on a small machine."""
CITY_PIXEL_M: Final = 0.05
"""Smaller pixels are for single buildings and finds."""
MAX_SMALL_BASE_TILES: Final = 2_000
"""As MAX_BASE_TILES, for pixels smaller than CITY_PIXEL_M: some screens."""
TEXELS_A_PIXEL: Final = 0.5
"""Finer pixels show no more of a texture."""
TRIANGLE_PX: Final = 64
"""Pixels along the side of a usual triangle; more show no more of the shape."""
TERRAIN_TRIANGLE_PX: Final = 16
"""As TRIANGLE_PX, for terrain, whose triangles have no sharp edges between them."""
TERRAIN_CLASSES: Final = ("terrain", "tinrelief", "relief_feature", "raster_relief")
"""Classes of the objects that are terrain."""
TEXTURED: Final = 0.1
"""The share of textured surfaces from which textures count."""
FINE: Final = 0.25
"""The share of the surfaces that may have finer texels than the resolution takes into account."""
TILE_PX: Final = 256

_PROBE_LEVEL: Final = 8


@dataclass(frozen=True)
class SurfaceDetail:
    """`texel_m`: side of the finer texels, None if there are no textures; `triangle_m`: side of a square as large as a usual triangle,
    which is `triangle_px` pixels long at the finest resolution that shows more of the shape."""

    texel_m: float | None
    triangle_m: float
    triangle_px: int = TRIANGLE_PX

    @property
    def pixel_m(self) -> float:
        """The size of pixels below which they show nothing more."""
        by_shape = self.triangle_m / self.triangle_px
        return by_shape if self.texel_m is None else min(by_shape, self.texel_m * TEXELS_A_PIXEL)

    def text(self) -> str:
        triangles = f"triangles of about {self.triangle_m:.3g} m"
        return triangles if self.texel_m is None else f"texels of about {self.texel_m:.3g} m and {triangles}"


@dataclass(frozen=True)
class Resolution:
    """`why`: the end of the sentence "resolution 0.1 m per pixel, since …"."""

    res_m: float
    why: str


def choose_resolution(scene: _core.Scene, views: list[ViewAngles], detail: SurfaceDetail | None) -> Resolution:
    """Returns the finest of RESOLUTIONS_M that the surfaces need, or a coarser one when it needs too many base tiles."""
    covered_m2 = _covered_m2(scene, views)
    for res_m in RESOLUTIONS_M:
        if _needs_too_many_tiles(res_m, covered_m2):
            continue
        if detail is None or res_m * 1.001 >= detail.pixel_m or res_m == RESOLUTIONS_M[-1]:
            return Resolution(res_m, _why(res_m, covered_m2, detail))
    return Resolution(RESOLUTIONS_M[-1], "the scene is too large for a finer one")


def surface_detail(areas: NDArray[np.float64], texels: NDArray[np.float64], terrain: NDArray[np.bool_]) -> SurfaceDetail | None:
    """Returns the detail of sampled triangles, or None. `areas`: square metres; `texels`: sides in metres, NaN without a texture. The usual
    triangle is one of terrain only where there is nothing else."""
    textured = np.isfinite(texels) & (areas > 0)
    seen = areas > 0
    if not seen.any():
        return None
    bare = not (seen & ~terrain).any()
    usual = areas[seen] if bare else areas[seen & ~terrain]
    triangle_m = float(np.sqrt(_quantile(usual, np.ones(len(usual)), 0.5)))
    has_textures = areas[textured].sum() >= TEXTURED * areas.sum()
    texel_m = _quantile(texels[textured], areas[textured], FINE) if has_textures else None
    return SurfaceDetail(texel_m, triangle_m, TERRAIN_TRIANGLE_PX if bare else TRIANGLE_PX)


def _why(res_m: float, covered_m2: float, detail: SurfaceDetail | None) -> str:
    finer = [value for value in RESOLUTIONS_M if value < res_m]
    if finer and _needs_too_many_tiles(finer[-1], covered_m2):
        return f"{finer[-1]:g} m would need more than {_max_base_tiles(finer[-1]):,} tiles"
    if detail is None or (not finer and detail.pixel_m <= res_m):
        return "it is the finest that is chosen without --res"
    return f"the surfaces have {detail.text()}, so that finer pixels would show nothing more"


def _needs_too_many_tiles(res_m: float, covered_m2: float) -> bool:
    return covered_m2 / (res_m * TILE_PX) ** 2 > _max_base_tiles(res_m)


def _max_base_tiles(res_m: float) -> int:
    return MAX_BASE_TILES if res_m >= CITY_PIXEL_M else MAX_SMALL_BASE_TILES


def _covered_m2(scene: _core.Scene, views: list[ViewAngles]) -> float:
    """Returns the area that the scene covers in all views together."""
    covered_m2 = 0.0
    for frame in pin(scene.box, TILE_PX, RESOLUTIONS_M[0], views):
        level = min(frame.zmax, _PROBE_LEVEL)
        covered_m2 += len(scene.occupied(core_frame(frame.to_json()), level)) * (frame.size_m / 2.0**level) ** 2
    return covered_m2


def _quantile(values: NDArray[np.float64], weights: NDArray[np.float64], share: float) -> float:
    """Returns the smallest value that this share of the weights does not exceed."""
    order = np.argsort(values, kind="stable")
    sums = np.cumsum(weights[order])
    return float(values[order][int(np.searchsorted(sums, share * sums[-1]))])
