"""Requests that read files: add files, inspect."""

from dataclasses import dataclass
from typing import Any, Final, Literal, NamedTuple, get_args

from map3d.requests.heights import HeightChoice
from map3d.requests.param import param

Axes = Literal["auto", "east-north", "north-east"]
AXES: Final[tuple[Axes, ...]] = get_args(Axes)
HeightUnit = Literal["auto", "m", "ft", "us-ft"]
HEIGHT_UNITS: Final[tuple[HeightUnit, ...]] = get_args(HeightUnit)
UNITS_M: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "ft": 0.3048, "us-ft": 1200 / 3937, "in": 0.0254}
"""Unit of a model → metres."""


class ModelOffset(NamedTuple):
    """What is added to the coordinates of a model, in units of its coordinate system."""

    east: float
    north: float
    height: float


def crs_param() -> Any:
    return param(
        None,
        help="Coordinate system of the files, where they do not state it or state it wrongly; 'local' for local metres.",
        label="Coordinate system of the files",
    )


@dataclass(frozen=True, kw_only=True)
class FormatOptions:
    """What to read of a format."""

    axes: str = param(
        "auto",
        help="Order of the first two numbers of positions; longitude counts as east. auto: by what the files show.",
        label="Order of the axes",
        choices=AXES,
    )
    height_unit: str = param(
        "auto",
        help="Unit of heights where the coordinate system does not state it. auto: by what the files show.",
        label="Unit of heights",
        choices=HEIGHT_UNITS,
    )
    up: str = param("z", help="OBJ: the axis that points up.", label="OBJ: upward axis", choices=("y", "z"))
    split: str = param("file", help="OBJ: the part that becomes one object.", label="OBJ: one object per", choices=("file", "group"))
    unit: str = param(
        "auto",
        help="OBJ: unit of the coordinates; auto: that of the coordinate system, metres without one.",
        label="OBJ: unit",
        choices=("auto", *UNITS_M),
    )
    offset: ModelOffset | None = param(
        None,
        help="OBJ: where the origin of the model lies: east, north and height in the coordinate system of the files.",
        example="691000,5336000,500",
        words="as a file beside the model says, else 0,0,0",
        label="OBJ: place of the origin",
    )
    theme: str | None = param(
        None, help="CityGML: the appearance theme to use.", words="the one with the most textures", label="CityGML: appearance theme"
    )
    lod: str | None = param(None, help="CityGML: the level of detail to use.", words="the best of each object", label="CityGML: level of detail")
    interiors: bool = param(False, help="CityGML: draw rooms and what is in them.", words="leave them out", label="CityGML: draw rooms")
    at: str | None = param(
        None,
        help="CityGML: draw the versions of objects that exist on this date.",
        example="2020-01-31",
        words="those that have not ended",
        label="CityGML: versions of objects on the date",
    )
    transparency: str = param(
        "auto",
        help="How transparency of materials is read; inverted: it is opacity; auto: as opacity in files whose materials would all be faint and some "
        "invisible.",
        label="Transparency of materials",
        choices=("auto", "as-is", "inverted"),
    )
    elevation: tuple[str, ...] = param(
        (),
        help="Rasters: names or patterns of those that give heights; the others give colours.",
        example="dtm_*.tif",
        words="found out by content and name",
        label="Rasters that give heights",
    )
    max_error_m: float = param(
        0.0,
        help="Elevation models: greatest height error in metres of the triangles; 0 keeps every height.",
        words="0",
        option="--max-error",
        label="Elevation models: greatest height error in metres",
        minimum=0.0,
    )


@dataclass(frozen=True, kw_only=True)
class ReadLimits:
    """Limits of the process that reads a file. None is the default of the format and size of the file."""

    parse_memory_bytes: int | None = param(
        None,
        help="Memory limit for reading a file.",
        example="2G",
        words="1G; 2G for rasters and above 100 MB",
        option="--parse-memory",
        label="Memory limit for reading a file",
        minimum=1,
        is_size=True,
    )
    parse_cpu_s: int | None = param(
        None,
        help="Limit in CPU seconds for reading a file.",
        words="60 per 100 MB; 600 for rasters",
        option="--parse-cpu",
        label="Limit in CPU seconds for reading a file",
        minimum=1,
    )


@dataclass(frozen=True, kw_only=True)
class AddFiles(FormatOptions, HeightChoice, ReadLimits):
    """Imports files into a scene."""

    crs: str | None = crs_param()
    name: str | None = param(None, help="Name of the asset, for a single file.", words="name of the file", label="Name of a single file")
    strict: bool = param(False, help="Stop at the first problem instead of skipping and counting it.", label="Stop at the first problem")
    skip_unchanged: bool = param(
        False,
        help="Leave files alone that are in the scene as they are.",
        lacks={
            "cli": "the command imports what it is given again, so that a user can repair an asset",
            "rest": "a repeated operation resumes where the first one stopped, so that unchanged files are always skipped",
            "studio": "as in the REST API",
        },
    )


@dataclass(frozen=True, kw_only=True)
class Inspect(FormatOptions, HeightChoice, ReadLimits):
    """Says what files hold."""

    crs: str | None = crs_param()
