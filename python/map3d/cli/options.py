"""Options that several commands share, and the types of their values."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar

import click

from map3d.catalogue import Workspace
from map3d.cores import usable_cores
from map3d.errors import BadRequest
from map3d.geometry.views import parse_view
from map3d.types import ViewAngles

Command = TypeVar("Command", bound=Callable[..., Any])

_UNITS: Final = {"": 1, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30, "t": 1 << 40}


def workspace_option(command: Command) -> Command:
    """Adds `-w`, passed as a Workspace."""
    return click.option(
        "-w",
        "--workspace",
        envvar="MAP3D_WORKSPACE",
        default="map3d-workspace",
        show_default=True,
        show_envvar=True,
        metavar="FOLDER",
        callback=lambda _ctx, _param, value: Workspace(Path(value)),
        help="Folder of scenes and renderings.",
    )(command)


def json_option(command: Command) -> Command:
    return click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of text.")(command)


def format_options(command: Command) -> Command:
    """Adds what to read of a format: `--up` and `--split` of OBJ, `--theme`, `--lod` and `--interiors` of CityGML, `--transparency`, `--max-error` of
    rasters."""
    for option in (
        click.option(
            "--max-error",
            "max_error_m",
            type=click.FloatRange(0.0),
            default=0.0,
            help="Elevation models: greatest height error in metres of the triangles; 0 keeps every height.  [default: 0]",
        ),
        click.option(
            "--transparency",
            type=click.Choice(["auto", "as-is", "inverted"]),
            default="auto",
            show_default=True,
            help="How transparency of materials is read; auto: as opacity in files whose materials would all be faint and some invisible.",
        ),
        click.option("--interiors", is_flag=True, help="CityGML: draw rooms and what is in them.  [default: leave them out]"),
        click.option("--lod", help="CityGML: the level of detail to use.  [default: the best of each object]"),
        click.option("--theme", help="CityGML: the appearance theme to use.  [default: the one with the most textures]"),
        click.option(
            "--split", type=click.Choice(["file", "group"]), default="file", show_default=True, help="OBJ: the part that becomes one object."
        ),
        click.option("--up", type=click.Choice(["y", "z"]), default="z", show_default=True, help="OBJ: the axis that points up."),
    ):
        command = option(command)
    return command


class Bytes(click.ParamType):  # type: ignore[type-arg]
    """A number of bytes, e.g. 512M or 2G."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if isinstance(value, int):
            return value
        match = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)\s*([kmgt]?)i?b?", str(value).strip().lower())
        if match is None or float(match[1]) <= 0:
            self.fail(f"{value!r} is not a size; write e.g. 512M or 2G", param, ctx)
        return int(float(match[1]) * _UNITS[match[2]])


class View(click.ParamType):  # type: ignore[type-arg]
    """A look-at angle and a pitch in degrees, e.g. 45-22.5 or 45/22.5."""

    name = "view"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> ViewAngles:
        if isinstance(value, ViewAngles):
            return value
        try:
            return parse_view(str(value))
        except BadRequest as error:
            self.fail(str(error), param, ctx)


def workers_option(command: Command) -> Command:
    return click.option(
        "--workers", type=click.IntRange(1, 512), default=usable_cores, show_default="one per core", help="Number of parallel render processes."
    )(command)


def outlier_options(command: Command) -> Command:
    """Adds `--keep-outliers` and `--cluster`: None where they are not given."""
    cluster = click.option(
        "--cluster",
        type=click.IntRange(0),
        help="Of files in places far from each other, build the place with this number; 0 is the largest.  [default: the largest]",
    )
    keep = click.option("--keep-outliers/--no-keep-outliers", default=None, help="Keep content far from the rest.  [default: leave it out]")
    return keep(cluster(command))


class Style(click.ParamType[Any]):
    """A style file, or "none": the rules."""

    name = "FILE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from map3d.renderings.style import read_style

        return value if isinstance(value, list) else [] if value == "none" else read_style(Path(value))


def style_option(command: Command) -> Command:
    """Adds `--style`: None where it is not given."""
    return click.option(
        "--style",
        type=Style(),
        help="JSON file with colours for surfaces that have none of their own; 'none' for the built-in ones.",
    )(command)


def max_memory_option(command: Command) -> Command:
    return click.option("--max-memory", type=Bytes(), help="Memory for all workers together, e.g. 2G.  [default: 512M of cache per worker]")(command)
