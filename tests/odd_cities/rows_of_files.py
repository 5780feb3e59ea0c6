"""Rows of the table of contradictions about files and their roles: copies, backups, textures, archives, rasters, models."""

import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from pyproj import Transformer

from tests.cli.towns import house
from tests.ingest.terrain.rasters import NORTH, WEST, colours, hills, write
from tests.odd_cities.contradictions import Row
from tests.odd_cities.rows_of_plan import only
from tests.odd_cities.test_file_roles import georeferenced, write_document, write_photo, write_world_file
from tests.odd_cities.towns import MUNICH, at, write_citygml

UTM = "EPSG:25832"
TOWN = only(UTM, MUNICH)


def place(east: float, north: float) -> tuple[float, float]:
    """Returns longitude and latitude of a place in UTM zone 32."""
    lon, lat = Transformer.from_crs(UTM, "EPSG:4326", always_xy=True).transform(east, north)
    return float(lon), float(lat)


def town(folder: Path, name: str = "town.gml") -> Path:
    return write_citygml(folder / name, UTM, at(*MUNICH, UTM))


def with_copies(*names: str) -> Callable[[Path], None]:
    """Returns what writes a town and copies of it."""

    def build(folder: Path) -> None:
        content = town(folder).read_bytes()
        for name in names:
            (folder / name).write_bytes(content)

    return build


def packed(folder: Path) -> None:
    path = town(folder)
    with zipfile.ZipFile(folder / "town.zip", "w") as archive:
        archive.write(path, "deep/town.gml")
    path.unlink()


def ortho_of_a_model(folder: Path) -> None:
    write_document(folder / "town.gml", georeferenced("ortho.jpg"))
    write_world_file(write_photo(folder / "ortho.jpg"), ".jgw")


def terrain(*others: str) -> Callable[[Path], None]:
    """Returns what writes an elevation model, and rasters of other numbers."""

    def build(folder: Path) -> None:
        folder.mkdir()
        write(folder / "dem.tif", np.full((1, 40, 40), 500.0, np.float32))
        for name in others:
            write(folder / name, np.abs(hills(40, 40)) * len(name))

    return build


def one_cut_photo(folder: Path) -> None:
    terrain()(folder)
    photo = write(folder / "dop.tif", colours(40, 40), blockysize=4)
    os.truncate(photo, photo.stat().st_size * 2 // 3)


def wide_photo(folder: Path) -> None:
    terrain()(folder)
    write(folder / "dop.tif", colours(40, 40).astype(np.uint16) * 257)


def model_with_offset(folder: Path) -> None:
    folder.mkdir()
    (folder / "house.obj").write_text(house(0.0, 0.0, 6.0))
    (folder / "house_offset.xyz").write_text(f"{WEST} {NORTH} 500\n")
    (folder / "house.prj").write_text('PROJCS["ETRS89 / UTM zone 32N",AUTHORITY["EPSG","25832"]]')


FLAT = (place(WEST + 20, NORTH - 20), (40.0, 40.0, 0.0), 1)
FILES: list[Row] = [
    Row("backups and copies", with_copies("town.gml~", "town.gml.bak", "town (1).gml"), *TOWN, 16, ("left-backup", "left-same-content")),
    Row("an archive in the folder", packed, *TOWN, 16),
    Row("a photo that is a texture", ortho_of_a_model, place(WEST + 5, NORTH + 5), (10.0, 10.0, 0.0), 1, ("used-as-texture",), textures=1),
    Row("aspect and surface beside terrain", terrain("aspect.tif", "DSM.tif"), *FLAT, ("raster-not-used",), textures=1),
    Row("a photo that is cut", one_cut_photo, *FLAT, ("raster-damaged",), textures=1),
    Row("a photo of 16 bits", wide_photo, *FLAT, ("photo-values-scaled",), textures=1),
    Row("a model with an offset", model_with_offset, place(WEST + 4, NORTH + 5), (8.0, 10.0, 6.0), 1, ("model-placed", "used-as-place")),
]
