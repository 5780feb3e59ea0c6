"""Options that all commands share. Those of verbs are made from requests (from_request.py)."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from map3d.catalogue import Workspace

Command = TypeVar("Command", bound=Callable[..., Any])


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
