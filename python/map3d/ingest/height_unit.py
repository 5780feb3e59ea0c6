"""Decides the unit of heights where a CRS states one for its plane alone: coordinates in feet, and heights in feet or metres."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from pyproj import CRS

from map3d.geometry.crs import horizontal_crs
from map3d.ingest.document_sample import DocumentSample
from map3d.ingest.evidence import HEIGHT_UNITS_M, Evidence
from map3d.ingest.findings import finding

STOREY_M: Final = 3.3
MOST_TIMES: Final = 1.9
"""Heights of buildings that a file states differ from those of its geometry by less, since they are measured to other edges."""
FOOT_M: Final = 0.3048
_METRES: Final = frozenset({"m", "metre", "meter", "metres", "meters", "urn:adv:uom:m", "urn:ogc:def:uom:epsg::9001"})
_FEET: Final = frozenset(
    {"ft", "[ft_i]", "foot", "feet", "usft", "ftus", "us-ft", "[ft_us]", "urn:ogc:def:uom:epsg::9002", "urn:ogc:def:uom:epsg::9003"}
)


@dataclass(frozen=True)
class ChosenUnit:
    """`metres`: of a unit of heights; None if the CRS states it. `findings`: what is said of the choice."""

    metres: float | None = None
    findings: tuple[dict[str, Any], ...] = ()


def choose_height_unit(source: CRS, label: str, evidence: Evidence) -> ChosenUnit:
    """Decides by the option, the words of the document, and the heights and storeys of its buildings; else takes the unit of the plane, and says
    so."""
    axis = horizontal_crs(source).axis_info[0]
    if len(source.axis_info) == 3:
        return ChosenUnit()
    if evidence.height_unit != "auto":
        return ChosenUnit(HEIGHT_UNITS_M[evidence.height_unit])
    plane_m = float(axis.unit_conversion_factor)
    if not horizontal_crs(source).is_projected or abs(plane_m - 1.0) < 1e-9:
        return ChosenUnit()
    labelled = _labelled_m(evidence.sample.units.get(label.strip(), ""), plane_m)
    if labelled is not None:
        return ChosenUnit(labelled)
    measured_m = _by_buildings(evidence.sample, plane_m)
    if measured_m is not None:
        unit = "metres" if measured_m == 1.0 else str(axis.unit_name)
        return ChosenUnit(measured_m, (finding("height-unit-by-buildings", 1, unit=unit),))
    said = finding("height-unit-of-plane", 1, "give --height-unit m if they are metres", unit=str(axis.unit_name))
    return ChosenUnit(plane_m, (said,))


def unit_m(text: str) -> float | None:
    """Returns the metres of a unit as files write it, None for one that is not known."""
    word = text.strip().lstrip("#").lower()
    return 1.0 if word in _METRES else FOOT_M if word in _FEET else None


def _labelled_m(labels: str, plane_m: float) -> float | None:
    words = labels.split()
    known = unit_m(words[2]) if len(words) == 3 else None
    return plane_m if known == FOOT_M else known


def _by_buildings(sample: DocumentSample, plane_m: float) -> float | None:
    """Compares the heights that buildings state with those that they have; None if these fit neither unit."""
    errors = list(_unit_errors(sample))
    if not errors:
        return None
    middle = float(np.median(errors))
    found = min((1.0, plane_m), key=lambda unit: abs(middle - math.log(unit)))
    return found if abs(middle - math.log(found)) <= math.log(MOST_TIMES) else None


def _unit_errors(sample: DocumentSample) -> Iterator[float]:
    """Yields, for each stated height, the logarithm of the metres that a unit of the coordinates would have by it."""
    for stated in sample.heights:
        tops = [ring.points[:, 2] for ring in sample.rings if ring.member == stated.member]
        if not tops or not stated.value > 0.0:
            continue
        heights = np.concatenate(tops)
        units = float(heights.max() - heights.min())
        metres = STOREY_M if stated.name == "storeysAboveGround" else unit_m(stated.unit)
        if metres is not None and units > 0.0 and math.isfinite(units):
            yield math.log(stated.value * metres / units)
