"""Options that several commands share, and the types of their values."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar

import click

from map3d.catalogue import Workspace
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


def cores() -> int:
    """Returns the number of CPU cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def workers_option(command: Command) -> Command:
    return click.option(
        "--workers", type=click.IntRange(1, 512), default=cores, show_default="one per core", help="Number of parallel render processes."
    )(command)


def max_memory_option(command: Command) -> Command:
    return click.option("--max-memory", type=Bytes(), help="Memory for all workers together, e.g. 2G.  [default: 512M of cache per worker]")(command)
