"""A small town as CityGML, written with whatever oddity a test asks for, and what an import draws of it."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from pyproj import Transformer

from map3d.catalogue import Workspace
from map3d.registry import Registry
from map3d.types import Box

LonLat = tuple[float, float]
MUNICH: LonLat = (11.5755, 48.1374)

HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<core:CityModel xmlns:core="http://www.opengis.net/citygml/2.0" xmlns:bldg="http://www.opengis.net/citygml/building/2.0"
 xmlns:app="http://www.opengis.net/citygml/appearance/2.0" xmlns:gml="http://www.opengis.net/gml" xmlns:xlink="http://www.w3.org/1999/xlink">
"""
Corners = np.ndarray
"""(n, 3) metres: east, north, up."""

ToNumbers = Callable[[Corners], np.ndarray]
"""Converts metres from the town's centre to the numbers of a file."""


def houses(side: int = 4, turn_deg: float = 20.0) -> Iterator[tuple[str, list[Corners]]]:
    """Yields the name and the six faces of side × side boxes of 8 × 12 m in a field of 40 m."""
    turn = np.radians(turn_deg)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    for row in range(side):
        for column in range(side):
            height = 6.0 + (3 * row + 5 * column) % 7
            corners = np.array([(x, y, z) for z in (0.0, height) for x, y in ((0, 0), (8, 0), (8, 12), (0, 12))])
            corners[:, :2] += (40.0 * (column - side / 2), 40.0 * (row - side / 2))
            corners[:, :2] = corners[:, :2] @ rotation.T
            rings = [(0, 3, 2, 1), (4, 5, 6, 7), *((k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4))]
            yield f"house-{row}-{column}", [corners[list(ring)] for ring in rings]


def at(lon: float, lat: float, crs: str, order: Sequence[int] = (0, 1, 2)) -> ToNumbers:
    """Returns the conversion to a CRS, x before y; `order` (1, 0, 2) writes y before x."""
    from_degrees = Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    to_degrees = Transformer.from_crs(f"+proj=tmerc +lon_0={lon} +lat_0={lat} +ellps=WGS84", "EPSG:4326", always_xy=True)

    def convert(corners: Corners) -> np.ndarray:
        x, y = from_degrees.transform(*to_degrees.transform(corners[:, 0], corners[:, 1]))
        return np.column_stack([x, y, corners[:, 2] + 500.0])[:, list(order)]

    return convert


def write_citygml(path: Path, srs_name: str | None, to_numbers: ToNumbers, *, side: int = 4, turn_deg: float = 20.0, prefix: str = "") -> Path:
    """Writes a town. `srs_name`: the label, None for none; `prefix`: of all names."""
    srs = f' srsName="{srs_name}" srsDimension="3"' if srs_name else ""
    members = []
    for name, faces in houses(side, turn_deg):
        polygons = "".join(
            f'<gml:surfaceMember><gml:Polygon gml:id="{prefix}{name}-{k}"><gml:exterior><gml:LinearRing gml:id="{prefix}{name}-{k}-r">'
            f'<gml:posList srsDimension="3">{_numbers(to_numbers(np.vstack([face, face[:1]])))}</gml:posList>'
            "</gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>"
            for k, face in enumerate(faces)
        )
        members.append(
            f'<core:cityObjectMember><bldg:Building gml:id="{prefix}{name}"><bldg:lod1MultiSurface><gml:MultiSurface{srs}>{polygons}'
            "</gml:MultiSurface></bldg:lod1MultiSurface></bldg:Building></core:cityObjectMember>\n"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(HEAD + "".join(members) + "</core:CityModel>\n")
    return path


def _numbers(points: np.ndarray) -> str:
    return " ".join(f"{value:.9f}" for value in points.ravel())


def world_boxes(workspace: Workspace, scene: str) -> dict[str, Box]:
    """Returns the box of each object that has triangles, in the scene's CRS."""
    catalogue = workspace.open_catalogue()
    origin = catalogue.scene(scene).origin
    catalogue.close()
    assert origin is not None
    with Registry(workspace.registry_path(scene)) as registry:
        found = {item.name: item.box for item in registry.objects() if item.box is not None}
    return {
        name: tuple(tuple(corner[k] + origin[k] for k in range(3)) for corner in box)  # type: ignore[misc]
        for name, box in found.items()
    }
