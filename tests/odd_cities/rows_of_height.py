"""Rows of the table of contradictions about heights, and about objects that several files have."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import rasterio
from pyproj import CRS, Transformer

from tests.coherence.documents import EAST, NORTH, STEP_M, UTM, town, write_dem, write_flat, write_houses, write_photo
from tests.odd_cities.contradictions import Row

_TO_DEGREES = Transformer.from_crs(UTM, "EPSG:4326", always_xy=True)
TOWN = _TO_DEGREES.transform(EAST + 65.0, NORTH + 64.0)
TILES = _TO_DEGREES.transform(EAST + 65.0, NORTH + 124.0)
WITHOUT_WEST = _TO_DEGREES.transform(EAST + 150.0, NORTH + 100.0)
"""Longitude and latitude of the middle of the town, of two towns, and of the terrain below them, whole and without its west."""
VOIDS = ("grid-points-without-height", "heights-void-value")
VOIDS_OF_TWO = (*VOIDS, "raster-under-others")
TERRAIN = _TO_DEGREES.transform(EAST + 100.0, NORTH + 100.0)


def _on_terrain(folder: Path, *, factor: float = 1.0, base: float | None = None, above: float = 0.0) -> None:
    write_houses(folder / "town.gml", town(base=base, above=above, factor=factor))
    write_dem(folder / "dem.tif")


def _tiles(folder: Path, *, base: float | None = None, above: float = 0.0, factor: float = 1.0) -> None:
    """Writes a town, and a smaller one north of it whose heights differ."""
    write_houses(folder / "south.gml", town("s"))
    houses = town("n", base=base, above=above, factor=factor, side=3)
    write_houses(folder / "north.gml", [replace(house, y=house.y + 4 * STEP_M) for house in houses])


def _model(folder: Path) -> None:
    """Writes a town, and between its houses a model that is one object 500 m below."""
    write_houses(folder / "town.gml", town())
    corners = [(EAST + x, NORTH + y, z) for z in (8.0, 14.0) for x, y in ((22.0, 20.0), (30.0, 20.0), (30.0, 28.0), (22.0, 28.0))]
    faces = ["f 4 3 2 1", "f 5 6 7 8", *(f"f {k + 1} {(k + 1) % 4 + 1} {(k + 1) % 4 + 5} {k + 5}" for k in range(4))]
    (folder / "model.obj").write_text("\n".join([*(f"v {x} {y} {z}" for x, y, z in corners), *faces]))
    (folder / "model.prj").write_text(CRS(UTM).to_wkt("WKT1_ESRI"))


def _voids(folder: Path, value: float, files: int = 1) -> None:
    """Writes a town and elevation models, whose westernmost 100 m have a value that means no height and is not declared."""
    write_houses(folder / "town.gml", town())
    for number in range(files):
        path = write_dem(folder / f"dem{number}.tif", 0.001 * number)
        with rasterio.open(path, "r+") as dem:
            heights = dem.read()
            heights[:, :, :20] = value
            dem.write(heights)


def _with(write: Callable[[Path], object], folder: Path) -> None:
    write_houses(folder / "town.gml", town(base=510.0))
    write(folder)


def _roads(folder: Path) -> None:
    write_flat(folder / "roads.gml", "tran:Road", {"r": [(0.0, 20.0, 0.0), (130.0, 20.0, 0.0), (130.0, 30.0, 0.0), (0.0, 30.0, 0.0)]}, dimension=2)


def _lods(folder: Path) -> None:
    write_houses(folder / "LoD1" / "690_5336.gml", town(base=510.0), lod=1)
    write_houses(folder / "LoD2" / "690_5336.gml", town(base=510.0), lod=2)


def _copy(folder: Path) -> None:
    write_houses(folder / "a.gml", town(base=510.0))
    write_houses(folder / "b.gml", town("other", base=510.0))


def _stray(folder: Path) -> None:
    houses = town(base=510.0)
    write_houses(folder / "a.gml", [*houses[:5], type(houses[5])("b5", houses[5].x, houses[5].y, -10.0), *houses[6:]])


TOWN_M = (130.0, 128.0, 9.0)
TILES_M = (130.0, 248.0)
TERRAIN_M = (400.0, 400.0)

HEIGHT: list[Row] = [
    Row(
        "a town 505 m below its terrain", partial(_on_terrain, above=-505.0), TERRAIN, (*TERRAIN_M, 520.0), 17, ("heights-below-terrain",), textures=1
    ),
    Row("the same, moved", partial(_on_terrain, above=-505.0), TERRAIN, (*TERRAIN_M, 20.0), 17, ("heights-moved",), {"heights": "505"}, textures=1),
    Row("a town at 0 on a hill", partial(_on_terrain, base=0.0), TERRAIN, (*TERRAIN_M, 520.0), 17, ("heights-at-zero",), textures=1),
    Row(
        "the same, set on it", partial(_on_terrain, base=0.0), TERRAIN, (*TERRAIN_M, 20.0), 17, ("objects-clamped",), {"heights": "clamp"}, textures=1
    ),
    Row("a town on the ellipsoid", partial(_on_terrain, above=46.5), TERRAIN, (*TERRAIN_M, 66.4), 17, ("heights-ellipsoidal",), textures=1),
    Row("heights in feet", partial(_on_terrain, factor=1 / 0.3048), TERRAIN, (*TERRAIN_M, 1205.9), 17, ("heights-in-feet",), textures=1),
    Row("the same, read so", partial(_on_terrain, factor=1 / 0.3048), TERRAIN, (*TERRAIN_M, 19.9), 17, (), {"height_unit": "ft"}, textures=1),
    Row("gaps that are 0", partial(_voids, value=0.0), WITHOUT_WEST, (300.0, 400.0, 14.9), 17, VOIDS, textures=1),
    Row(
        "gaps that are -9999 in two models",
        partial(_voids, value=-9999.0, files=2),
        WITHOUT_WEST,
        (300.0, 400.0, 14.9),
        17,
        VOIDS_OF_TWO,
        textures=1,
    ),
    Row("one house 520 m below the others", _stray, TOWN, (130.0, 128.0, 529.0), 16, ("objects-off-ground",)),
    Row("a tile 500 m below the one beside it", partial(_tiles, above=-500.0), TILES, (*TILES_M, 515.0), 25, ("heights-unlike-file",)),
    Row("the same tile, moved", partial(_tiles, above=-500.0), TILES, (*TILES_M, 15.0), 25, ("heights-moved",), {"heights": "500"}),
    Row("a tile at 0 beside another", partial(_tiles, base=0.0), TILES, (*TILES_M, 520.0), 25, ("heights-at-zero-beside-file",)),
    Row("the same tile, set on the ground", partial(_tiles, base=0.0), TILES, (*TILES_M, 15.0), 25, ("objects-clamped",), {"heights": "clamp"}),
    Row("a tile on the ellipsoid", partial(_tiles, above=46.5), TILES, (*TILES_M, 59.5), 25, ("heights-ellipsoidal-beside-file",)),
    Row("a tile in feet", partial(_tiles, factor=1 / 0.3048), TILES, (*TILES_M, 1194.6), 25, ("heights-in-feet-beside-file",)),
    Row("a model of one object 500 m below", _model, TOWN, (130.0, 128.0, 512.0), 17, ("heights-unlike-file", "model-placed")),
    Row("roads without heights", partial(_with, _roads), TOWN, TOWN_M, 17, ("flat-objects-draped", "polygon-without-height")),
    Row(
        "a photo without elevation model",
        partial(_with, lambda folder: write_photo(folder / "ortho.tif")),
        TERRAIN,
        (*TERRAIN_M, 9.0),
        17,
        ("photo-draped-on-bases",),
        textures=1,
    ),
]

SAME_OBJECTS: list[Row] = [
    Row("two levels of detail of one town", _lods, TOWN, TOWN_M, 16, ("objects-finer-elsewhere",)),
    Row("the same houses under other names", _copy, TOWN, TOWN_M, 16, ("file-is-copy",)),
]
