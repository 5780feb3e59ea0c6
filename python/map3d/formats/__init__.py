"""The formats that are imported: a module and a row each."""

from typing import Final

from map3d.formats.citygml import CITYGML
from map3d.formats.obj import OBJ
from map3d.formats.raster import RASTER
from map3d.formats.source_format import SourceFormat

FORMATS: Final[tuple[SourceFormat, ...]] = (CITYGML, OBJ, RASTER)
"""In the order of import: CityGML files name the CRS of the scene, which OBJ files and rasters may lack."""


def find_format(name: str) -> SourceFormat:
    """Returns the format with this name."""
    return next(format for format in FORMATS if format.name == name)


def title_of(name: str) -> str:
    """Returns what people read for the format of an asset, which may be of an earlier version of map3d."""
    return next((format.title for format in FORMATS if format.name == name), name)
