"""Which system an asset's coordinates are in, and how they come into the scene's."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS
from pyproj.crs import CompoundCRS

from map3d.catalogue import SceneCrs
from map3d.errors import CrsError
from map3d.ingest.crs import LOCAL, is_local, parse_crs, scene_crs, vertical
from map3d.ingest.crs_transformer import Points, Projection, choose_target

LOCAL_NAME: Final = "local"
_MAY_BE_UNNAMED: Final = ("obj",)


class Placing:
    """Brings the positions of one asset into the scene's system; if the scene has none yet, the first positions decide it."""

    def __init__(self, format: str, named: str | None, scene: str | None) -> None:
        """`named`: what the user or the source calls the asset's system; `scene`: the scene's as text, "local", or None while it has none.

        Raises CrsError where the two cannot go together.
        """
        self._format, self.named = format, named
        self._scene_is_local = scene is not None and is_local(scene)
        self._target = None if scene is None or self._scene_is_local else CRS.from_user_input(scene)
        self._source = None if named is None or is_local(named) else parse_crs(named)
        self._projection: Projection | None = None
        if self._source is not None and self._scene_is_local:
            raise CrsError(
                f"the file is in {self._source.name}, the scene in local metres; put it into another scene, or give --crs local to take it as it is"
            )

    def world(self, points: Points) -> Points:
        """(n, 3) world coordinates; raises CrsError when it is not known what the points are."""
        if self._source is None:
            self._check_unnamed()
            return points
        if self._projection is None:
            self._target = self._target or _with_height(choose_target(self._source, points), self._source)
            self._projection = Projection(self._source, self._target)
        return self._projection.world(points)

    def world_transforms(self, transforms: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m, 12) prototype → world."""
        if self._source is None:
            return transforms
        if self._projection is None and len(transforms):
            self.world(transforms.reshape(-1, 3, 4)[:, :, 3])
        return transforms if self._projection is None else self._projection.world_transforms(transforms)

    @property
    def proposed(self) -> SceneCrs | None:
        """What the scene's system is to be, if it has none; None when nothing was placed."""
        if self._target is not None:
            return scene_crs(self._target)
        return LOCAL if self._source is None else None

    @property
    def report(self) -> dict[str, Any]:
        if self._projection is not None:
            return self._projection.report
        return {
            "from": self.named or "no system named",
            "to": self._target.name if self._target is not None else LOCAL.name,
            "operation": "none: taken as they are",
        }

    def _check_unnamed(self) -> None:
        if self.named is None and self._format not in _MAY_BE_UNNAMED and not self._scene_is_local:
            raise CrsError("the file does not name its coordinate system; name it with --crs, e.g. --crs EPSG:25832, or --crs local for plain metres")


def _with_height(target: CRS, source: CRS) -> CRS:
    """The scene takes over the vertical system of its first asset."""
    height = vertical(source)
    if height is None or target.is_compound:
        return target
    return CompoundCRS(name=f"{target.name} + {height.name}", components=[target, height])
