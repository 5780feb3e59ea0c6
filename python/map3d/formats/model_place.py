"""Where files beside a model say that it lies: the offset and the coordinate system that photogrammetry programs write with an OBJ.

* Pix4D, CloudCompare and others: `NAME_offset.xyz` (three numbers), and `NAME_wkt.prj` or `NAME.prj`
* ContextCapture, Metashape, DJI Terra: `metadata.xml` with SRS and SRSOrigin, beside the model or above it
* OpenDroneMap: `coords.txt` or `odm_georeferencing_model_geo.txt` (`WGS84 UTM 32N`, and easting and northing), for models named `..._geo`
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from typing import Final

Offset = tuple[float, float, float]

_MAX_BYTES: Final = 1 << 16
_LEVELS: Final = 4
"""Folders above a model in which metadata.xml may be."""
_BESIDE: Final = (".", "..", "../params", "../../params", "../../1_initial/params", "../odm_georeferencing")
"""Folders with offsets and coordinate systems, from that of the model."""
_OFFSET_NAME: Final = re.compile(
    r"(?P<model>.*?)[-_. ]?(?:local|global|srs|crs)?[-_ ]?(?:offset|shift|origin|translation)\.(?:xyz|txt)", re.IGNORECASE
)
_CRS_NAME: Final = re.compile(r"(?P<model>.*?)(?:[-_. ]?(?:wkt|crs|srs|projection))?\.prj", re.IGNORECASE)
_ODM_NAMES: Final = ("coords.txt", "odm_georeferencing_model_geo.txt")
_ODM_CRS: Final = re.compile(r"\s*WGS\s?84\s+UTM\s+(\d{1,2})\s?([NS])\s*", re.IGNORECASE)
_NUMBER: Final = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBERS: Final = re.compile(rf"\s*[\[(]?\s*({_NUMBER})[\s,;]+({_NUMBER})(?:[\s,;]+({_NUMBER}))?\s*[\])]?\s*")
_SRS: Final = re.compile(r"<SRS>([^<]{1,20000})</SRS>")
_ORIGIN: Final = re.compile(r"<SRSOrigin>([^<]{1,1000})</SRSOrigin>")
_ENU: Final = re.compile(rf"ENU:\s*({_NUMBER})\s*,\s*({_NUMBER})", re.IGNORECASE)


@dataclass(frozen=True)
class ModelPlace:
    """`offset`: to be added to the coordinates, None if no file has one; `crs`: the name or definition of the system of the sums, None if no file has
    one; `files`: those that say so; `unreadable`: one that seems to say so and cannot be read."""

    offset: Offset | None = None
    crs: str | None = None
    files: tuple[Path, ...] = ()
    unreadable: Path | None = None


def find_model_place(model: Path, root: Path | None = None) -> ModelPlace | None:
    """Returns what the files beside a model say, None if there are none. `root`: the folder in which they must be, by default that of the model."""
    base = (root or model.parent).resolve()
    for find in (_find_metadata, _find_odm, _find_offset):
        place = find(model, base)
        if place is not None:
            return place
    crs = _find_crs(model, base, model.stem)
    return None if crs is None else ModelPlace(None, _read(crs), (crs,))


def _find_metadata(model: Path, root: Path) -> ModelPlace | None:
    """Reads the nearest metadata.xml of a block of models."""
    for folder in list(model.resolve().parents)[:_LEVELS]:
        path = folder / "metadata.xml"
        if folder.is_relative_to(root) and path.is_file() and "<ModelMetadata" in (text := _read(path)):
            crs, origin = _SRS.search(text), _ORIGIN.search(text)
            offset = None if origin is None else _parse_offset(origin[1])
            if crs is None or (origin is not None and offset is None):
                return ModelPlace(unreadable=path)
            return ModelPlace(offset or (0.0, 0.0, 0.0), _crs_of_srs(unescape(crs[1]).strip()), (path,))
    return None


def _crs_of_srs(text: str) -> str:
    """Returns the system of an SRS of metadata.xml. `ENU:LAT,LON` is a plane that touches the Earth there."""
    enu = _ENU.fullmatch(text)
    return text if enu is None else f"+proj=aeqd +lat_0={enu[1]} +lon_0={enu[2]} +datum=WGS84 +units=m +no_defs +type=crs"


def _find_odm(model: Path, root: Path) -> ModelPlace | None:
    if not model.stem.lower().endswith("_geo"):
        return None
    for path in _files_beside(model, root):
        if path.name.lower() in _ODM_NAMES:
            first, _, rest = _read(path).strip().partition("\n")
            crs, offset = _ODM_CRS.fullmatch(first), _parse_offset(rest.strip().partition("\n")[0])
            if crs is None or offset is None:
                return ModelPlace(unreadable=path)
            return ModelPlace(offset, f"EPSG:{(32600 if crs[2].upper() == 'N' else 32700) + int(crs[1])}", (path,))
    return None


def _find_offset(model: Path, root: Path) -> ModelPlace | None:
    found = [(path, match["model"]) for path in _files_beside(model, root) if (match := _OFFSET_NAME.fullmatch(path.name))]
    own = [(path, name) for path, name in found if _belongs(name, model)]
    if not own:
        return None
    path, name = max(own, key=lambda item: (len(item[1]), -len(item[0].parts)))
    lines = _read(path).strip().splitlines()
    offset = _parse_offset(lines[0]) if len(lines) == 1 else None
    if offset is None:
        return ModelPlace(unreadable=path)
    crs = _find_crs(model, root, name or model.stem)
    return ModelPlace(offset, None if crs is None else _read(crs), (path,) if crs is None else (path, crs))


def _find_crs(model: Path, root: Path, name: str) -> Path | None:
    """Returns the .prj file of the model, or of the `name` of its offset."""
    found = [(path, match["model"]) for path in _files_beside(model, root) if (match := _CRS_NAME.fullmatch(path.name))]
    own = [(path, stem) for path, stem in found if _belongs(stem, model) or stem.lower() == name.lower()]
    return max(own, key=lambda item: (len(item[1]), -len(item[0].parts)))[0] if own else None


def _belongs(name: str, model: Path) -> bool:
    """Whether a file of this name, without the words for what it is, is about the model: Pix4D's `house_offset.xyz` about
    `house_simplified_3d_mesh.obj`, and `offset.xyz` about all models of its folder."""
    return model.stem.lower().startswith(name.lower())


def _files_beside(model: Path, root: Path) -> Iterator[Path]:
    for place in _BESIDE:
        folder = (model.parent / place).resolve()
        if folder.is_dir() and folder.is_relative_to(root):
            yield from sorted(path for path in folder.iterdir() if path.suffix.lower() in (".xyz", ".txt", ".prj") and path.is_file())


def _read(path: Path) -> str:
    with path.open("rb") as file:
        return file.read(_MAX_BYTES).decode("utf-8-sig", "replace").strip()


def _parse_offset(text: str) -> Offset | None:
    """Returns two or three numbers, the third of which is 0 if it is not there."""
    found = _NUMBERS.fullmatch(text)
    return None if found is None else (float(found[1]), float(found[2]), float(found[3] or 0.0))
