"""The group of all verbs, and what becomes of errors."""

import importlib
import os
import sys
import traceback
from typing import Any, Final

import click

from map3d import __version__
from map3d.errors import Map3dError

VERBS: Final = {
    "create-scene": "create_scene",
    "add-files": "add_files",
    "create-rendering": "create_rendering",
    "add-views": "add_views",
    "add-layers": "add_layers",
    "estimate": "estimate",
    "render": "render",
    "retry": "retry",
    "serve": "serve",
    "publish": "publish",
    "site": "site",
    "verify": "verify",
    "show": "show",
    "make-town": "make_town",
    "teatime": "teatime",
}


class Verbs(click.Group):
    """Loads a verb's module when it is asked for, and lists the verbs in the order of work."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        command: click.Command = importlib.import_module(f"map3d.cli.{VERBS[cmd_name]}").command
        return command


@click.group(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="map3d")
def cli() -> None:
    """Turns 3D city models into oblique image tiles that any phone can show.

    \b
    The usual way:
      map3d create-scene town                           a place for files
      map3d add-files town buildings.gml terrain.tif    CityGML, OBJ, GeoTIFF
      map3d create-rendering town town-4 --res 0.2      what to see of it
      map3d render town-4                               make the tiles
      map3d serve                                       look at them

    Or all of it at once: map3d site FOLDER -o OUT
    """


def main() -> None:
    """Runs the command line and ends the process: 0 done, 1 failed, 2 asked for something impossible, 130 interrupted."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """The exit status. Errors are one line that says what to do; with MAP3D_DEBUG set, a traceback."""
    try:
        status: Any = cli.main(arguments, prog_name="map3d", standalone_mode=False)
        return status if isinstance(status, int) else 0
    except click.exceptions.Exit as error:
        return error.exit_code
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return 0
    except click.ClickException as error:
        click.echo(f"map3d: {error.format_message()}{_see(error)}", err=True)
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        click.echo("map3d: stopped; give the same command again to go on", err=True)
        return 130
    except BaseException as error:
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        if os.environ.get("MAP3D_DEBUG"):
            traceback.print_exc()
        click.echo(f"map3d: {_line(error)}", err=True)
        return error.exit_code if isinstance(error, Map3dError) else 1


def _see(error: click.ClickException) -> str:
    context = error.ctx if isinstance(error, click.UsageError) else None
    return f" See {context.command_path} --help." if context else ""


def _line(error: BaseException) -> str:
    """A panic of the compiled core is no Exception, but as much a bug as one."""
    if isinstance(error, Map3dError) or any(base.__name__ in ("CoreError", "TownError") for base in type(error).__mro__):
        return str(error)
    if isinstance(error, ImportError) and "map3d._core" in str(error):
        return f"the compiled core is not there ({error}); install map3d with pip, or run `maturin develop --release` in a checkout"
    return f"{type(error).__name__}: {error} (set MAP3D_DEBUG=1 to see where; this is a bug of map3d)"
