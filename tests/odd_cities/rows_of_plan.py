"""Rows of the table of contradictions about the plan: order of axes, place, coordinate system, datum, unit."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from pyproj import CRS, Transformer

from tests.odd_cities.contradictions import Row, Size
from tests.odd_cities.strays import move_corner, move_polygon
from tests.odd_cities.towns import MUNICH, LonLat, at, houses, write_citygml

WARSAW, FIELDS, NEW_YORK, TOKYO, LONDON = (21.010, 52.231), (18.5, 52.7), (-73.98, 40.75), (139.70, 35.68), (-0.12, 51.5)
HONG_KONG, SINGAPORE, BUCHAREST = (114.17, 22.30), (103.85, 1.29), (26.10, 44.43)
MONTREAL, EAST_OF_LONDON = (-73.57, 45.50), (-0.118, 51.5)
NEAR_MUNICH = (MUNICH[0] + 0.003, MUNICH[1])
BESIDE_FIELDS = (18.5, 52.703)
EAST_FIRST, NORTH_FIRST = (0, 1, 2), (1, 0, 2)
URN = "urn:ogc:def:crs:EPSG::"
LABELS = '" axisLabels="'
"""Between a name and the labels of its axes."""
FOOT = 1200 / 3937

Build = Callable[[Path], object]


def corners(crs: str, place: LonLat, *, side: int = 4, turn_deg: float = 20.0) -> np.ndarray:
    """Returns the corners of a town of `write_citygml`, (n, 3)."""
    return np.concatenate([at(*place, crs)(np.concatenate(faces)) for _, faces in houses(side, turn_deg)])


def only(crs: str, place: LonLat, *, side: int = 4, turn_deg: float = 20.0) -> tuple[LonLat, Size]:
    """Returns the middle and the extent of a town, in a CRS of metres."""
    return extent(crs, corners(crs, place, side=side, turn_deg=turn_deg))


def extent(crs: str, *towns: np.ndarray) -> tuple[LonLat, Size]:
    """Returns the place and the extent of towns together."""
    points = np.concatenate(towns)
    low, high = points.min(axis=0), points.max(axis=0)
    lon, lat = Transformer.from_crs(crs, "EPSG:4326", always_xy=True).transform(*((low + high) / 2)[:2])
    x, y, z = high - low
    return (float(lon), float(lat)), (float(x), float(y), float(z))


def town(label: str, place: LonLat, crs: str, order: Sequence[int] = EAST_FIRST, *, side: int = 4, turn_deg: float = 20.0) -> Build:
    return lambda folder: write_citygml(folder / "town.gml", label, at(*place, crs, order), side=side, turn_deg=turn_deg)


def house(label: str, place: LonLat, crs: str, order: Sequence[int] = EAST_FIRST) -> Build:
    """A single one along the axes, which does not tell its order of axes."""
    return lambda folder: write_citygml(folder / "house.gml", label, at(*place, crs, order), side=1, turn_deg=0.0, prefix="single-")


def both(*builds: Build) -> Build:
    return lambda folder: [build(folder) for build in builds]


def files(*towns: tuple[str, str, LonLat, str, Sequence[int], int]) -> Build:
    """Writes towns: name, label, place, CRS, order of axes, houses along a side."""

    def build(folder: Path) -> None:
        for name, label, place, crs, order, side in towns:
            write_citygml(folder / f"{name}.gml", label, at(*place, crs, order), side=side, prefix=f"{name}-")

    return build


def in_row(x_km: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda corners: corners + np.array([500_000.0 + 1000.0 * x_km, 5_500_000.0, 300.0])


def in_feet(folder: Path, text: str = "") -> None:
    """Writes a town in feet, heights too; `text` follows the beginning of each building, with its height in feet as %f."""

    def to_feet(corners: np.ndarray) -> np.ndarray:
        return at(*NEW_YORK, "EPSG:2263")(corners) * [1.0, 1.0, 1 / FOOT]

    path = write_citygml(folder / "town.gml", "EPSG:2263", to_feet)
    parts = path.read_text().split("<bldg:lod1MultiSurface>")
    heights = [faces[1][0, 2] for _, faces in houses()]
    path.write_text(
        parts[0]
        + "".join((text % height if text else "") + "<bldg:lod1MultiSurface>" + part for height, part in zip(heights, parts[1:], strict=True))
    )


def metres_in_feet(folder: Path, text: str = "") -> None:
    """Writes a town whose plane is in feet and whose heights are in metres."""
    path = write_citygml(folder / "town.gml", "EPSG:2263", at(*NEW_YORK, "EPSG:2263"))
    parts = path.read_text().split("<bldg:lod1MultiSurface>")
    heights = [faces[1][0, 2] for _, faces in houses()]
    path.write_text(
        parts[0]
        + "".join((text % height if text else "") + "<bldg:lod1MultiSurface>" + part for height, part in zip(heights, parts[1:], strict=True))
    )


def without_zone(folder: Path) -> None:
    """Writes a town in zone 4 of Gauss and Krüger, northing first, without the 4 before the easting."""
    in_zone = at(*MUNICH, "EPSG:31468")
    write_citygml(folder / "town.gml", URN + "31468", lambda corners: (in_zone(corners) - [4_000_000.0, 0.0, 0.0])[:, [1, 0, 2]])


def degrees(place: LonLat, label: str, crs: str = "EPSG:4326") -> Build:
    """A town in degrees, latitude first."""
    return town(label, place, crs, NORTH_FIRST)


def polygon_moved(build: Build, points: Sequence[Sequence[float]]) -> Build:
    def moved(folder: Path) -> None:
        build(folder)
        move_polygon(folder / "town.gml", np.array(points, dtype=np.float64))

    return moved


def corner_moved(build: Build, corner: Sequence[float], *, by: bool = False) -> Build:
    def moved(folder: Path) -> None:
        build(folder)
        move_corner(folder / "town.gml", np.array(corner, dtype=np.float64), by=by)

    return moved


AXES: list[Row] = [
    Row("URN of 2180, northing first", town(URN + "2180", WARSAW, "EPSG:2180", NORTH_FIRST), *only("EPSG:2180", WARSAW), 16),
    Row("URN of 2180, easting first", town(URN + "2180", WARSAW, "EPSG:2180"), *only("EPSG:2180", WARSAW), 16),
    Row(
        "EPSG:2180, northing first",
        town("EPSG:2180", WARSAW, "EPSG:2180", NORTH_FIRST),
        *only("EPSG:2180", WARSAW),
        16,
        ("axes-read-as-northing-easting",),
    ),
    Row("EPSG:2180, easting first", town("EPSG:2180", WARSAW, "EPSG:2180"), *only("EPSG:2180", WARSAW), 16),
    Row(
        "one house, URN, northing first",
        house(URN + "2180", FIELDS, "EPSG:2180", NORTH_FIRST),
        *only("EPSG:2180", FIELDS, side=1, turn_deg=0.0),
        1,
        ("axes-ambiguous",),
    ),
    Row(
        "one house, easting first",
        house("EPSG:2180", FIELDS, "EPSG:2180"),
        *only("EPSG:2180", FIELDS, side=1, turn_deg=0.0),
        1,
        ("axes-ambiguous",),
    ),
    Row(
        "one house, --axes",
        house(URN + "2180", FIELDS, "EPSG:2180"),
        *only("EPSG:2180", FIELDS, side=1, turn_deg=0.0),
        1,
        options={"axes": "east-north"},
    ),
    Row(
        "one house, axisLabels",
        house(f"EPSG:2180{LABELS}N E h", FIELDS, "EPSG:2180", NORTH_FIRST),
        *only("EPSG:2180", FIELDS, side=1, turn_deg=0.0),
        1,
    ),
    Row(
        "one house, --crs urn",
        house("EPSG:2180", FIELDS, "EPSG:2180", NORTH_FIRST),
        *only("EPSG:2180", FIELDS, side=1, turn_deg=0.0),
        1,
        options={"crs": URN + "2180"},
    ),
    Row(
        "one house beside a town, easting first under a URN",
        both(town(URN + "2180", FIELDS, "EPSG:2180"), house(URN + "2180", BESIDE_FIELDS, "EPSG:2180")),
        *extent("EPSG:2180", corners("EPSG:2180", FIELDS), corners("EPSG:2180", BESIDE_FIELDS, side=1, turn_deg=0.0)),
        17,
        ("axes-like-other-files",),
    ),
    *(
        Row(f"{form} of 2180, northing first", town(escape(text, {'"': "&quot;"}), WARSAW, "EPSG:2180", NORTH_FIRST), *only("EPSG:2180", WARSAW), 16)
        for form, text in (("WKT 2", CRS.from_epsg(2180).to_wkt()), ("PROJJSON", CRS.from_epsg(2180).to_json()))
    ),
    *(
        Row(f"URN of {code}, northing first", town(URN + str(code), place, f"EPSG:{code}", NORTH_FIRST), *only(f"EPSG:{code}", place), 16)
        for code, place in ((2326, HONG_KONG), (3414, SINGAPORE), (3844, BUCHAREST), (6677, TOKYO), (3035, MUNICH), (31468, MUNICH))
    ),
    Row(
        "longitude first in New York beside Munich",
        files(("a", "EPSG:25832", MUNICH, "EPSG:25832", EAST_FIRST, 5), ("b", "EPSG:4979", NEW_YORK, "EPSG:4326", EAST_FIRST, 4)),
        *only("EPSG:25832", MUNICH, side=5),
        25,
        ("axes-read-as-longitude-latitude",),
        left_out=192,
    ),
    Row(
        "the larger place determines the CRS, not the first file",
        files(("a", "EPSG:4979", NEW_YORK, "EPSG:4326", EAST_FIRST, 2), ("b", "EPSG:25832", MUNICH, "EPSG:25832", EAST_FIRST, 5)),
        *only("EPSG:25832", MUNICH, side=5),
        25,
        ("axes-read-as-longitude-latitude",),
        left_out=48,
    ),
]

IN_DEGREES = (
    ("Tokyo", TOKYO, "http://www.opengis.net/def/crs/EPSG/0/6697", "EPSG:6691", ("points-outside-area-of-use",), ("coordinate-not-finite",)),
    ("Munich", MUNICH, "EPSG:4326", "EPSG:32632", (), ()),
    ("New York", NEW_YORK, "EPSG:4269", "EPSG:26918", (), ()),
)
"""Name, place, label, CRS of the scene; what is said of points in the wrong place, and of swapped ones: a latitude of 139° does not exist."""


def _strays() -> Iterator[Row]:
    for name, place, label, crs, outside, swapped in IN_DEGREES:
        whole = degrees(place, label)
        lon, lat = place
        exchanged = [(lon, lat, 500), (lon, lat + 1e-4, 500), (lon + 1e-4, lat, 500)]
        nowhere = [(500, 500, 500), (500, 501, 500), (501, 500, 500)]
        metres = [(4e6, 5e5, 500), (4e6, 5e5 + 10, 500), (4e6 + 10, 5e5, 500)]
        drawn = only(crs, place)
        yield Row(f"{name} in degrees, a corner at 0 0 0", corner_moved(whole, (0, 0, 0)), *drawn, 16, outside, left_out=1)
        said, left_out = outside + swapped, 0 if swapped else 1
        yield Row(f"{name} in degrees, a polygon with swapped axes", polygon_moved(whole, exchanged), *drawn, 16, said, left_out=left_out)
        for what, points in (("at 500 degrees", nowhere), ("in metres", metres)):
            said = (*outside, "coordinate-not-finite")
            yield Row(f"{name} in degrees, a polygon {what}", polygon_moved(whole, points), *drawn, 16, said)


STRAYS = list(_strays())

PLACES: list[Row] = [
    Row(
        "pseudo-Mercator",
        town("EPSG:3857", MUNICH, "EPSG:3857"),
        *only("EPSG:32632", MUNICH),
        16,
        ("crs-stretches",),
    ),
    Row("World Mercator", town("EPSG:3395", MUNICH, "EPSG:3395"), *only("EPSG:32632", MUNICH), 16, ("crs-stretches",)),
    Row(
        "towns 9, 26, 105 and 420 km apart",
        lambda folder: [write_citygml(folder / f"t{k}.gml", "EPSG:25832", in_row(x), prefix=f"{k}-") for k, x in enumerate((0, 9, 35, 140, 560))],
        *extent("EPSG:25832", *(in_row(x)(np.concatenate([face for _, faces in houses() for face in faces])) for x in (0, 9))),
        32,
        ("points-outside-area-of-use",),
        left_out=3 * 16 * 12,
    ),
    Row(
        "a corner 3 km away",
        corner_moved(town("EPSG:25832", MUNICH, "EPSG:25832"), (3000.0, 0.0, 0.0), by=True),
        *only("EPSG:25832", MUNICH),
        16,
        ("stray-vertex",),
    ),
]

DATUMS: list[Row] = [
    Row(
        "London in ETRS89 and OSGB36",
        lambda folder: [
            write_citygml(folder / "a.gml", "EPSG:4258", at(*LONDON, "EPSG:4258", NORTH_FIRST)),
            write_citygml(folder / "b.gml", "EPSG:27700", at(*EAST_OF_LONDON, "EPSG:27700"), prefix="b-"),
        ],
        *extent("EPSG:25830", corners("EPSG:25830", LONDON), corners("EPSG:25830", EAST_OF_LONDON)),
        32,
        ("transformed-inexactly",),
    ),
    Row(
        "a datum that is known by grids alone",
        lambda folder: [
            write_citygml(folder / "a.gml", "EPSG:32618", at(*MONTREAL, "EPSG:32618")),
            write_citygml(folder / "b.gml", "EPSG:4609", at(*MONTREAL, "EPSG:4326", NORTH_FIRST), prefix="b-"),
        ],
        *only("EPSG:32618", MONTREAL),
        16,
        failed=("install it with projsync --file",),
    ),
]

UNITS: list[Row] = [
    Row("feet without a unit of heights", in_feet, *only("EPSG:26918", NEW_YORK), 16, ("height-unit-of-plane",)),
    Row(
        "feet, and heights that buildings state in feet",
        lambda folder: in_feet(folder, '<bldg:measuredHeight uom="m">%f</bldg:measuredHeight>'),
        *only("EPSG:26918", NEW_YORK),
        16,
        ("height-unit-by-buildings",),
    ),
    Row(
        "feet, and heights that are in metres by what buildings state",
        lambda folder: metres_in_feet(folder, '<bldg:measuredHeight uom="m">%f</bldg:measuredHeight>'),
        *only("EPSG:26918", NEW_YORK),
        16,
        ("height-unit-by-buildings",),
    ),
    Row(
        "feet, and --height-unit m",
        metres_in_feet,
        *only("EPSG:26918", NEW_YORK),
        16,
        options={"height_unit": "m"},
    ),
]

PREFIXES: list[Row] = [
    Row("EPSG:4647 without the zone", town("EPSG:4647", MUNICH, "EPSG:25832"), *only("EPSG:4647", MUNICH), 16, ("easting-zone-prefix",)),
    Row("EPSG:25832 with the zone", town("EPSG:25832", MUNICH, "EPSG:4647"), *only("EPSG:25832", MUNICH), 16, ("easting-zone-prefix",)),
    Row(
        "a zone of Gauss and Krüger that is missing, northing first",
        without_zone,
        *only("EPSG:31468", MUNICH),
        16,
        ("easting-zone-prefix",),
    ),
    Row(
        "with the zone beside without it",
        files(("a", "EPSG:25832", MUNICH, "EPSG:4647", EAST_FIRST, 4), ("b", "EPSG:4647", NEAR_MUNICH, "EPSG:25832", EAST_FIRST, 4)),
        *extent("EPSG:25832", corners("EPSG:25832", MUNICH), corners("EPSG:25832", NEAR_MUNICH)),
        32,
        ("easting-zone-prefix",),
    ),
    Row("EPSG:4647 with the zone", town("EPSG:4647", MUNICH, "EPSG:4647"), *only("EPSG:4647", MUNICH), 16),
]

PLAN: list[Row] = [*PREFIXES, *AXES, *STRAYS, *PLACES, *DATUMS, *UNITS]
