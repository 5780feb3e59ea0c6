"""Rows of the table of contradictions about the plan: order of axes, place, coordinate system, datum, unit."""

import numpy as np

from tests.odd_cities.contradictions import Row, Size
from tests.odd_cities.towns import MUNICH, at, houses, write_citygml


def size(crs: str, place: tuple[float, float]) -> Size:
    """Returns the extent of a town of `write_citygml` in a CRS of metres."""
    corners = np.concatenate([at(*place, crs)(np.concatenate(faces)) for _, faces in houses()])
    x, y, z = corners.max(axis=0) - corners.min(axis=0)
    return float(x), float(y), float(z)


PLAN: list[Row] = [
    Row(
        "longitude first under a label with latitude first",
        lambda folder: write_citygml(folder / "town.gml", "EPSG:4326", at(*MUNICH, "EPSG:4326")),
        MUNICH,
        size("EPSG:32632", MUNICH),
        16,
        ("axes-read-as-longitude-latitude",),
    ),
]
