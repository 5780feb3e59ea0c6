"""Determines the CRS of an asset's coordinates and transforms them to the scene's."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS
from pyproj.crs import CompoundCRS

from map3d.catalogue import SceneCrs
from map3d.errors import CrsError
from map3d.formats import find_format
from map3d.geometry.crs import has_ellipsoidal_heights, horizontal_crs, is_local, parse_crs, vertical_crs, vertical_crs_name
from map3d.ingest.axis_order import is_north_first
from map3d.ingest.coordinate_check import CoordinateCheck
from map3d.ingest.crs_transformer import CrsTransformer, Points
from map3d.ingest.evidence import Evidence
from map3d.ingest.exactness import better_words, stretch_findings, transformation_findings
from map3d.ingest.height_unit import ChosenUnit, choose_height_unit
from map3d.ingest.scene_crs import LOCAL, choose_scene_crs, to_scene_crs
from map3d.messages import message
from map3d.requests.reading import Axes


class AssetReprojector:
    """Transforms the positions of one asset to the scene's CRS. While the scene has none, the first positions determine it."""

    def __init__(self, format: str, asset_crs: str | None, scene_crs: str | None, *, stated: bool = False, evidence: Evidence | None = None) -> None:
        """`asset_crs`: the name given by the user (`stated`) or the file, or None; `scene_crs`: WKT, "local", or None while the scene has no CRS;
        `evidence`: what else is known of the document.

        Raises CrsError if the two are incompatible.
        """
        self._evidence, self._unit, self._stretched = evidence or Evidence(), ChosenUnit(), list[dict[str, Any]]()
        self._format, self._asset_crs = format, asset_crs
        self._scene_is_local = scene_crs is not None and is_local(scene_crs)
        self._target = None if scene_crs is None or self._scene_is_local else CRS.from_user_input(scene_crs)
        self._source = None if asset_crs is None or is_local(asset_crs) else parse_crs(asset_crs)
        self._transformer: CrsTransformer | None = None
        self._check = None
        if self._source is not None:
            self._check = CoordinateCheck(self._source, asset_crs or "", stated=stated, target=self._target, evidence=self._evidence)
        if self._source is not None and self._scene_is_local:
            raise CrsError(
                f"the file is in {self._source.name}, but the scene is in local metres; "
                "add the file to another scene, or give --crs local to keep its coordinates as they are"
            )

    def to_world(self, points: Points) -> Points:
        """Returns (n, 3) world coordinates. Raises CrsError if the CRS of the points is unknown."""
        if self._source is None or self._check is None:
            self._check_crs_is_optional()
            return points
        points = self._check.ordered(np.asarray(points, dtype=np.float64))
        if self._transformer is None:
            self._transformer = self._choose_transformer(self._source, self._check, points)
        return self._transformer.to_world(points)

    def _choose_transformer(self, source: CRS, check: CoordinateCheck, points: Points) -> CrsTransformer:
        place = None if check.place is None else (check.place.lon, check.place.lat)
        self._target = target = self._target or _with_vertical_crs(choose_scene_crs(source, points, check.middle), source)
        self._stretched = stretch_findings(source, target, place)
        self._unit = choose_height_unit(source, self._asset_crs or "", self._evidence)
        return CrsTransformer(source, target, place, self._unit.metres)

    def transforms_to_world(self, transforms: NDArray[np.float64]) -> NDArray[np.float64]:
        """Converts (m, 12) prototype-to-source transforms to prototype-to-world."""
        if self._source is None or self._check is None:
            return transforms
        if self._transformer is None and len(transforms):
            self.to_world(transforms.reshape(-1, 3, 4)[:, :, 3])
        transforms = self._check.ordered_transforms(transforms)
        return transforms if self._transformer is None else self._transformer.transforms_to_world(transforms)

    @property
    def proposed_crs(self) -> SceneCrs | None:
        """The CRS for a scene that has none; None before any position was transformed."""
        if self._target is not None:
            proposed = to_scene_crs(self._target)
            is_ellipsoidal = self._source is not None and proposed.vertical is None and has_ellipsoidal_heights(self._source)
            return replace(proposed, vertical=vertical_crs_name(self._source)) if self._source is not None and is_ellipsoidal else proposed
        return LOCAL if self._source is None else None

    @property
    def report(self) -> dict[str, Any]:
        if self._transformer is not None:
            place = None if self._check is None else self._check.place
            return self._transformer.report | ({} if place is None else {"place": str(place)})
        return {
            "from": self._asset_crs or "no CRS named",
            "to": self._target.name if self._target is not None else LOCAL.name,
            "operation": "none: coordinates are unchanged",
        }

    @property
    def findings(self) -> list[dict[str, Any]]:
        """Returns what is odd about the coordinates, as findings of a report."""
        return [] if self._check is None else self._check.findings

    @property
    def notes(self) -> list[dict[str, Any]]:
        """Returns what is worth knowing about their transformation and units, as findings of a report."""
        exactness = [] if self._transformer is None else transformation_findings(self._transformer.transformation, self.report)
        return [*self._stretched, *self._unit.findings, *exactness]

    @property
    def axes(self) -> Axes:
        """The order of axes of the coordinates; "auto" until some are transformed, and where the name of the CRS leaves no doubt."""
        if self._source is None or self._check is None:
            return "auto"
        horizontal = horizontal_crs(self._source)
        in_doubt = is_north_first(horizontal) and not (horizontal.is_geographic and self._check.axes == "north-east")
        return self._check.axes if in_doubt else "auto"

    @property
    def better(self) -> str:
        """The words about a better transformation that lacks a grid, empty without one."""
        return "" if self._transformer is None else better_words(self._transformer.transformation)

    def _check_crs_is_optional(self) -> None:
        if self._asset_crs is None and find_format(self._format).has_crs and not self._scene_is_local:
            raise CrsError(message("crs-missing"))


def _with_vertical_crs(target: CRS, source: CRS) -> CRS:
    """The scene adopts the vertical CRS of its first asset."""
    vertical = vertical_crs(source)
    if vertical is None or target.is_compound:
        return target
    return CompoundCRS(name=f"{target.name} + {vertical.name}", components=[target, vertical])
