"""Asks before something is removed."""

import sys
from collections.abc import Callable
from typing import Any, TypeVar

import click

from map3d.errors import FAILED, BadRequest

Command = TypeVar("Command", bound=Callable[..., Any])


def yes_option(command: Command) -> Command:
    return click.option("--yes", "-y", is_flag=True, help="Do not ask for confirmation.")(command)


def confirm(what: str, *, yes: bool) -> None:
    """Shows what is about to be removed and asks for confirmation on standard error. Exits with status 1 if the user declines.

    Raises BadRequest when there is no terminal to ask at and `--yes` is missing.
    """
    if yes:
        return
    if not sys.stdin.isatty():
        raise BadRequest(f"{what}; there is no terminal to confirm it at: run the command again with --yes")
    if not click.confirm(f"{what}. Continue?", err=True):
        click.echo("nothing was removed", err=True)
        raise click.exceptions.Exit(FAILED)
