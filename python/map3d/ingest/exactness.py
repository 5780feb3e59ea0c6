"""Says how exact a transformation between two datums is, and which grid would make it better."""

from collections.abc import Mapping
from typing import Any, Final

from map3d.geometry.transformations import Transformation
from map3d.ingest.findings import finding

EXACT_M: Final = 1.0
"""Nothing is said about transformations that are at least so accurate, such as between ETRS89 and WGS 84."""


def transformation_findings(transformation: Transformation, placing: Mapping[str, Any], file: str = "") -> list[dict[str, Any]]:
    """Returns what is worth knowing, as findings of a report. `placing`: {"from", "to"}: names of the two CRSs; `file`: that was transformed, where
    the report is of several."""
    values = {"source": placing["from"], "target": placing["to"]}
    about = f"{file}: " if file else ""
    if transformation.inexact:
        return [finding("datum-without-name", 1, f"{about}{transformation.description}", **values)]
    accuracy = transformation.accuracy_m
    if accuracy is not None and accuracy <= EXACT_M:
        return []
    example = f"{about}{transformation.description}{better_words(transformation)}"
    if accuracy is None:
        return [finding("transformed-with-unknown-accuracy", 1, example, **values)]
    return [finding("transformed-inexactly", 1, example, **values, accuracy=accuracy)]


def better_words(transformation: Transformation) -> str:
    """Returns e.g. "; DHDN to ETRS89 (8) needs the grid de_adv_BETA2007.tif: projsync --file de_adv_BETA2007.tif installs it"."""
    if transformation.better is None:
        return ""
    if not transformation.grids:
        return f"; {transformation.better} is not available"
    grid = transformation.grids[0]
    return f"; {transformation.better} needs the grid {grid}: projsync --file {grid} installs it"
