"""Says how exact positions in a scene are: the transformation between two datums, the grid that would make it better, and lengths that are none."""

from collections.abc import Mapping
from typing import Any, Final

from pyproj import CRS

from map3d.geometry.crs import horizontal_crs, is_metric
from map3d.geometry.transformations import LonLat, Transformation
from map3d.ingest.findings import finding
from map3d.ingest.scene_crs import length_error, stretches

EXACT_M: Final = 1.0
"""Nothing is said about transformations that are at least so accurate, such as between ETRS89 and WGS 84."""


def transformation_findings(transformation: Transformation, placing: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Returns what is worth knowing, as findings of a report. `placing`: {"from", "to"}: names of the two CRSs."""
    values = {"source": placing["from"], "target": placing["to"]}
    if transformation.inexact:
        return [finding("datum-without-name", 1, transformation.description, **values)]
    accuracy = transformation.accuracy_m
    if accuracy is not None and accuracy <= EXACT_M:
        return []
    example = f"{transformation.description}{better_words(transformation)}"
    if accuracy is None:
        return [finding("transformed-with-unknown-accuracy", 1, example, **values)]
    return [finding("transformed-inexactly", 1, example, **values, accuracy=accuracy)]


def stretch_findings(source: CRS, scene: CRS, place: LonLat | None) -> list[dict[str, Any]]:
    """Returns what is worth knowing about lengths, as findings of a report: in the CRS of the scene, else in the one that the file left for it."""
    for crs, code in ((scene, "scene-crs-stretches"), (source, "crs-stretches")):
        if place is not None and is_metric(crs) and stretches(crs, *place):
            factor = round(1.0 + length_error(crs, *place), 4)
            return [finding(code, 1, name=str(horizontal_crs(crs).name), factor=factor, scene=str(horizontal_crs(scene).name))]
    return []


def better_words(transformation: Transformation) -> str:
    """Returns e.g. "; DHDN to ETRS89 (8) needs the grid de_adv_BETA2007.tif: projsync --file de_adv_BETA2007.tif installs it"."""
    if transformation.better is None:
        return ""
    if not transformation.grids:
        return f"; {transformation.better} is not available"
    grid = transformation.grids[0]
    return f"; {transformation.better} needs the grid {grid}: projsync --file {grid} installs it"
