"""Options that several verbs share, and how their values are read."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar

import click

from map3d.catalogue import Workspace
from map3d.types import ViewAngles

Command = TypeVar("Command", bound=Callable[..., Any])

_UNITS: Final = {"": 1, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30, "t": 1 << 40}


def workspace_option(command: Command) -> Command:
    """`-w`: passed as a Workspace."""
    return click.option(
        "-w",
        "--workspace",
        envvar="MAP3D_WORKSPACE",
        default="map3d-workspace",
        show_default=True,
        show_envvar=True,
        metavar="FOLDER",
        callback=lambda _ctx, _param, value: Workspace(Path(value)),
        help="Where map3d keeps scenes and renderings.",
    )(command)


def json_option(command: Command) -> Command:
    return click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of text.")(command)


class Bytes(click.ParamType):  # type: ignore[type-arg]
    """A number of bytes such as 512M or 2G."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if isinstance(value, int):
            return value
        match = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)\s*([kmgt]?)i?b?", str(value).strip().lower())
        if match is None or float(match[1]) <= 0:
            self.fail(f"{value!r} is not a size; write it like 512M or 2G", param, ctx)
        return int(float(match[1]) * _UNITS[match[2]])


class View(click.ParamType):  # type: ignore[type-arg]
    """LOOK-AT/PITCH in degrees, e.g. 45/22.5."""

    name = "look-at/pitch"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> ViewAngles:
        if isinstance(value, ViewAngles):
            return value
        look_at, slash, pitch = str(value).partition("/")
        try:
            return ViewAngles(float(look_at), float(pitch) if slash else 45.0)
        except ValueError:
            self.fail(f"{value!r} is not a view; write look-at/pitch in degrees, e.g. 45/22.5 (0 looks north, 45 north-west)", param, ctx)


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def workers_option(command: Command) -> Command:
    return click.option(
        "--workers", type=click.IntRange(1, 512), default=cores, show_default="one for each core", help="How many processes render at a time."
    )(command)


def max_memory_option(command: Command) -> Command:
    return click.option("--max-memory", type=Bytes(), help="Memory for all workers together, e.g. 2G.  [default: 512M of cache for each worker]")(
        command
    )
