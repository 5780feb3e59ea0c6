"""What each raster of a terrain may give, heights or colours, by its content, its metadata and its name."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final, Literal

from rasterio.enums import ColorInterp

from map3d.errors import BadRequest
from map3d.ingest.terrain.raster_georeference import open_raster

Gives = Literal["heights", "colours"]

_LEVEL_UNITS: Final = ("m", "metre", "meter", "metres", "meters", "ft", "foot", "feet", "us-ft", "ftus")
_OTHER_UNITS: Final = ("degree", "degrees", "deg", "°", "percent", "%", "radian", "radians")


def _listed(words: str) -> frozenset[str]:
    return frozenset(words.split())


TERRAIN_WORDS: Final = _listed(
    "dtm dgm dem dhm mnt mdt mde terrain ground bareearth bare elevation elevations altitude altitudes altimetry swissalti"
    " hoehe höhe hoehen höhen height heights relief srtm"
)
SURFACE_WORDS: Final = _listed("dsm dom bdom mns mds surface swisssurface")
DERIVED_WORDS: Final = _listed(
    "slope slopes aspect hillshade hillshades hillshading shade shaded shading roughness tri tpi twi curvature svf skyview openness intensity density"
    " ndvi contour contours flow flowdir flowacc accumulation exposure ndsm ndom chm mnh canopy neigung hangneigung exposition schummerung schatten"
    " pente pentes ombrage estompage pendiente orientacion sombreado mask masks count counts quality uncertainty error errors"
)
"""What is computed from heights, or measured with them; heights over ground are no heights over sea level."""
PHOTO_WORDS: Final = _listed("ortho orthophoto dop photo foto image rgb rgbi tci pan nir red green blue sentinel landsat aerial luftbild")
FALSE_COLOUR_WORDS: Final = _listed("cir nir irrg irg falsecolor falsecolour false infrared infrarot")


@dataclass(frozen=True)
class RasterRole:
    """`rank`: of several rasters at one place, those of the lowest count. `kind`: what it is, in the words of messages. `is_unclear`: it may be meant
    to give the other."""

    path: Path
    gives: Gives
    rank: int
    kind: str
    is_unclear: bool = False


NO_HEIGHTS: Final = 9
"""Rank of rasters of numbers that are no heights by what they say; they give heights only where nothing else does."""


def find_roles(paths: Sequence[Path], elevation: Sequence[str], reliefs: frozenset[Path]) -> list[RasterRole]:
    """Returns the role of each raster. `elevation`: the user's names or patterns of those that give heights, none to find out; `reliefs`: those that
    a RasterRelief names. Raises BadRequest for names that no raster has."""
    folder = Path(os.path.commonpath([path.parent for path in paths])) if paths else Path()
    for pattern in elevation:
        if not any(_matches(path, pattern) for path in paths):
            raise BadRequest(f"--elevation {pattern}: no raster has this name; there are {', '.join(path.name for path in paths[:5])}")
    roles = []
    for path in paths:
        with open_raster(path) as raster:
            found = _find_role(path, raster, _words(path, folder))
        if path in reliefs or any(_matches(path, pattern) for pattern in elevation):
            found = RasterRole(path, "heights", 0, "chosen")
        elif elevation and found.gives == "heights":
            found = RasterRole(path, "heights", NO_HEIGHTS, "not among those chosen")
        elif elevation:
            found = RasterRole(path, found.gives, found.rank, found.kind)
        roles.append(found)
    return roles


def _find_role(path: Path, raster: Any, words: frozenset[str]) -> RasterRole:
    bands = [band for band in raster.colorinterp if band is not ColorInterp.alpha]
    if len(bands) >= 3:
        is_false = bool(words & FALSE_COLOUR_WORDS)
        return RasterRole(path, "colours", int(is_false), "false colours by its name" if is_false else "a picture in colours")
    if bands[0] is ColorInterp.palette:
        return RasterRole(path, "colours", 1, "a picture with a palette")
    if raster.dtypes[0] in ("uint8", "int8"):
        is_derived, is_height = bool(words & DERIVED_WORDS), bool(words & (TERRAIN_WORDS | SURFACE_WORDS))
        kind = "a measure of the terrain by its name" if is_derived else "a picture in grey"
        return RasterRole(path, "colours", 3 if is_derived else 2, kind, is_unclear=is_height and not is_derived)
    return _role_of_numbers(path, raster, words)


def _role_of_numbers(path: Path, raster: Any, words: frozenset[str]) -> RasterRole:
    """Returns the role of a raster of one band of numbers that may be heights."""
    unit = (raster.units[0] or "").strip().lower()
    said = words | _split_words(raster.descriptions[0] or "")
    if unit in _OTHER_UNITS:
        return RasterRole(path, "heights", NO_HEIGHTS, f"in {unit}, no height")
    if said & DERIVED_WORDS:
        return RasterRole(path, "heights", NO_HEIGHTS, f"{min(said & DERIVED_WORDS)} by its name, no height")
    if unit not in _LEVEL_UNITS and said & PHOTO_WORDS and not said & (TERRAIN_WORDS | SURFACE_WORDS) and raster.dtypes[0] in ("uint16", "int16"):
        return RasterRole(path, "colours", 2, "one band of a picture by its name")
    if said & SURFACE_WORDS:
        return RasterRole(path, "heights", 2, "a surface with buildings and trees by its name")
    return RasterRole(path, "heights", 0 if said & TERRAIN_WORDS else 1, "terrain by its name" if said & TERRAIN_WORDS else "heights")


def _words(path: Path, folder: Path) -> frozenset[str]:
    """Returns the words of a raster's name or, if they say nothing, of the nearest folder below `folder` whose name says something."""
    known = TERRAIN_WORDS | SURFACE_WORDS | DERIVED_WORDS | PHOTO_WORDS | FALSE_COLOUR_WORDS
    parts = path.relative_to(folder).parts if path.is_relative_to(folder) else (path.name,)
    for part in (Path(parts[-1]).stem, *reversed(parts[:-1])):
        if found := _split_words(part) & known:
            return found
    return frozenset()


def _split_words(text: str) -> frozenset[str]:
    """Returns the words of a name such as `DTM_1m`, `dgm1`, `SlopeDegrees` or `digital-terrain-model`."""
    parts = re.findall(r"[A-ZÄÖÜ]+(?![a-zäöüß])|[A-ZÄÖÜ]?[a-zäöüß]+", text) + re.findall(r"[a-zäöüß]+", text.lower())
    return frozenset(part.lower() for part in parts)


def _matches(path: Path, pattern: str) -> bool:
    """Whether a pattern, such as `dtm_*.tif`, is the name of a raster, or the end of its path."""
    wanted = pattern.lower()
    return any(fnmatchcase(text, wanted) for text in (path.name.lower(), path.as_posix().lower())) or path.as_posix().lower().endswith(f"/{wanted}")
