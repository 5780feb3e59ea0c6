"""The group of all commands, and the handling of errors."""

import importlib
import os
import sys
import traceback
from difflib import get_close_matches
from typing import Any, Final

import click

from map3d import __version__
from map3d.errors import FAILED, INTERRUPTED, Map3dError

COMMANDS: Final = {
    "create-workspace": "create_workspace",
    "create-scene": "create_scene",
    "inspect": "inspect",
    "add-files": "add_files",
    "create-rendering": "create_rendering",
    "change-rendering": "change_rendering",
    "add-views": "add_to_rendering:add_views",
    "add-layers": "add_to_rendering:add_layers",
    "estimate": "estimate",
    "render": "render",
    "work": "work",
    "jobs": "jobs",
    "retry": "jobs:retry",
    "operations": "operations",
    "serve": "serve",
    "users": "users",
    "tokens": "tokens",
    "publish": "publish",
    "export": "export",
    "site": "site",
    "verify": "verify",
    "show": "show",
    "remove-files": "remove:remove_files",
    "remove-rendering": "remove:remove_rendering",
    "remove-scene": "remove:remove_scene",
    "demo": "demo",
    "make-town": "make_town",
    "teatime": "make_town:teatime",
}
"""Command → module of map3d.cli, and the name that the command has there unless it is `command`; in the order of the help."""
_LONGEST_SENTENCE: Final = 200


class Commands(click.Group):
    """Loads the module of a command on first use, lists the commands with whole sentences, and suggests the nearest one for a misspelt command."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, _, name = COMMANDS[cmd_name].partition(":")
        command: click.Command = getattr(importlib.import_module(f"map3d.cli.{module}"), name or "command")
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            if near := get_close_matches(args[0], COMMANDS, 1):
                raise click.UsageError(f"{error.message} Did you mean {near[0]}?", ctx) from error
            raise

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Lists each command with its whole first sentence, which click would cut off at the end of the line."""
        commands = ((name, self.get_command(ctx, name)) for name in COMMANDS)
        with formatter.section("Commands"):
            formatter.write_dl([(name, command.get_short_help_str(_LONGEST_SENTENCE)) for name, command in commands if command is not None])


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="map3d")
def cli() -> None:
    """Turn 3D city models into oblique image tiles that any phone can show.

    \b
    Typical use:
      map3d create-scene town                           create an empty scene
      map3d add-files town buildings.gml terrain.tif    import CityGML, OBJ, GeoTIFF
      map3d create-rendering town town-4 --res 0.2      choose views and resolution
      map3d render town-4                               render the tiles
      map3d serve town-4                                open the map in a browser

    \b
    All steps at once:     map3d site FOLDER -o OUT
    With a generated town: map3d demo
    """


def main() -> None:
    """Runs the command line and exits with a code of `EXIT_CODES`."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Runs the command line and returns the exit status. Prints errors on one line; with MAP3D_DEBUG set, prints a traceback too."""
    try:
        status: Any = cli.main(arguments, prog_name="map3d", standalone_mode=False)
        return status if isinstance(status, int) else 0
    except click.exceptions.Exit as error:
        return error.exit_code
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return 0
    except click.ClickException as error:
        click.echo(f"map3d: {_usage_line(error)}", err=True)
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        click.echo("map3d: stopped; re-run the command to resume", err=True)
        return INTERRUPTED
    except BaseException as error:
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        if os.environ.get("MAP3D_DEBUG"):
            traceback.print_exc()
        click.echo(f"map3d: {_line(error)}", err=True)
        return error.exit_code if isinstance(error, Map3dError) else FAILED


def _usage_line(error: click.ClickException) -> str:
    """Returns the error as one line that names the command's help."""
    message, context = error.format_message(), error.ctx if isinstance(error, click.UsageError) else None
    if context is None:
        return message
    return f"{message}{'' if message.endswith(('.', '?')) else '.'} See {context.command_path} --help."


def _line(error: BaseException) -> str:
    """Returns the error as one line. A panic of the compiled core is a BaseException and is reported as a bug, like any unexpected exception."""
    if isinstance(error, Map3dError) or any(base.__name__ in ("CoreError", "TownError") for base in type(error).__mro__):
        return str(error)
    if isinstance(error, ImportError) and "map3d._core" in str(error):
        return f"cannot import the compiled core ({error}); install map3d with pip, or run `make build` in a checkout"
    return f"{type(error).__name__}: {error} (this is a bug in map3d; set MAP3D_DEBUG=1 for a traceback)"
