"""The ground of a scene below its objects: terrain where there is any, else interpolated between the bases of its buildings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from map3d import _core
from map3d.coherence.surveyed_assets import Flags, Floats, SurveyedAsset
from map3d.ingest.ground_grid import GroundGrid

STANDING: Final = ("building", "building_part", "other_construction", "generic")
"""Classes of objects whose lowest point is on the ground; `generic` are those of formats without classes."""

_INSET: Final = 0.1


@dataclass(frozen=True)
class Ground:
    """`terrain`: asset → (wholes,) the lowest height of the terrain at five points of the box of each whole, NaN where there is none. `surfaces`: of
    the terrain; `grid`: between the bases of objects."""

    terrain: Mapping[str, Floats]
    surfaces: Sequence[_core.Surface]
    grid: GroundGrid | None

    def below(self, asset: SurveyedAsset) -> Floats:
        """Returns (wholes,) the terrain or, where there is none, the ground between bases; NaN without either."""
        terrain = self.terrain[asset.name]
        return np.where(np.isfinite(terrain), terrain, _between(asset, self.grid))


def find_ground(assets: Sequence[SurveyedAsset], kept: Mapping[str, Flags]) -> Ground:
    """Compares all documents with all terrain in one pass over it. `kept`: asset → (wholes,) whether a whole is drawn."""
    documents = [asset for asset in assets if not asset.is_raster]
    surfaces = terrain_surfaces(assets, kept, is_adjusted=False)
    points = {asset.name: _sample_points(asset.boxes[asset.drawn]) for asset in documents}
    if surfaces and points:
        heights = np.split(_core.surface_heights(surfaces, np.concatenate(list(points.values()))), np.cumsum([len(p) for p in points.values()])[:-1])
    else:
        heights = [np.full(len(p), np.nan) for p in points.values()]
    terrain = {asset.name: _spread(asset.drawn, _lowest(found)) for asset, found in zip(documents, heights, strict=True)}
    bases = [bases_of(asset, kept[asset.name]) for asset in documents if len(asset.boxes)]
    grid = GroundGrid.of_bases(np.concatenate(bases)) if bases else None
    return Ground(terrain, surfaces, grid)


def terrain_surfaces(assets: Sequence[SurveyedAsset], kept: Mapping[str, Flags], *, is_adjusted: bool) -> list[_core.Surface]:
    """Returns the surfaces of elevation models and of relief in documents."""
    found = []
    for asset in assets:
        chosen = asset.is_terrain & kept[asset.name] if not asset.is_raster else np.full(len(asset.firsts), asset.has_heights)
        if chosen.any():
            found.append(_core.Surface.of_asset(str(asset.folder), asset.spread(chosen), is_adjusted))
    return found


def bases_of(asset: SurveyedAsset, kept: Flags, heights: Floats | None = None) -> Floats:
    """Returns (n, 3) the middle of the lower face of the box of each object that stands on the ground. `heights`: (wholes,), else as imported."""
    chosen = kept & asset.drawn & np.isin(asset.classes, STANDING)
    boxes = asset.boxes[chosen]
    return np.column_stack([(boxes[:, 0, :2] + boxes[:, 1, :2]) / 2, boxes[:, 0, 2] if heights is None else heights[chosen]])


def _between(asset: SurveyedAsset, grid: GroundGrid | None) -> Floats:
    if grid is None:
        return np.full(len(asset.firsts), np.nan)
    centres = (asset.boxes[asset.drawn, 0, :2] + asset.boxes[asset.drawn, 1, :2]) / 2
    return _spread(asset.drawn, grid.at(centres[:, 0], centres[:, 1]))


def _sample_points(boxes: Floats) -> Floats:
    """Returns (5 n, 2) the centre of each box, and four points near its corners."""
    low, high = boxes[:, 0, :2], boxes[:, 1, :2]
    inset = (high - low) * _INSET
    near, far = low + inset, high - inset
    corners = [(low + high) / 2, near, far, np.column_stack([near[:, 0], far[:, 1]]), np.column_stack([far[:, 0], near[:, 1]])]
    return np.stack(corners, axis=1).reshape(-1, 2)


def _lowest(heights: Floats) -> Floats:
    """Returns the lowest of each five heights, NaN where none is known."""
    each = np.where(np.isfinite(heights), heights, np.inf).reshape(-1, 5).min(axis=1) if len(heights) else np.empty(0)
    return np.where(np.isfinite(each), each, np.nan)


def _spread(chosen: Flags, values: Floats) -> Floats:
    found = np.full(len(chosen), np.nan)
    found[chosen] = values
    return found
