"""map3d create-rendering."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from map3d.catalogue import Workspace
from map3d.cli.building import build_with_progress
from map3d.cli.layer_options import layer_options
from map3d.cli.options import View, json_option, max_memory_option, outlier_options, style_option, workspace_option
from map3d.cli.output import plural, print_json
from map3d.cores import usable_cores
from map3d.errors import BadRequest
from map3d.geometry.views import views_around
from map3d.types import ViewAngles

if TYPE_CHECKING:
    from map3d.renderings.style import Rules


class WindowText(click.ParamType):  # type: ignore[type-arg]
    """X,Y,SIZE in metres."""

    name = "x,y,size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, float, float]:
        if isinstance(value, tuple):
            return value
        try:
            x, y, size = (float(part) for part in str(value).split(","))
        except ValueError:
            self.fail(f"{value!r} is not a window; write X,Y,SIZE in metres, e.g. 691000,5336000,2000", param, ctx)
        return x, y, size


@click.command("create-rendering")
@click.argument("scene")
@click.argument("name")
@click.option("--view", "views", type=View(), multiple=True, help="Look-at angle and pitch in degrees, e.g. 45-22.5; repeatable.")
@click.option("--directions", type=click.IntRange(1, 360), help="Instead of --view: number of evenly spaced look-at angles.  [default: 4]")
@click.option("--pitch", type=float, multiple=True, help="Pitch for --directions, in degrees; 90 looks straight down; repeatable.  [default: 45]")
@click.option("--res", "res_m", type=float, help="Metres per pixel at the deepest level.")
@click.option("--levels", type=click.IntRange(1, 27), help="Instead of --res: number of levels.")
@click.option(
    "--window",
    type=WindowText(),
    help="Render only a square of SIZE metres in each view, centred on the ground point X, Y in the scene's coordinate system.",
)
@layer_options()
@click.option("--tile-size", type=click.Choice(["256", "512"]), default="256", show_default=True, help="Side of a tile in pixels.")
@click.option("--title", default="", help="Display title.  [default: the scene's]")
@click.option("--attribution", default="", help="Attribution text.  [default: the scene's]")
@click.option(
    "--tiles",
    metavar="URL",
    help="Store the tiles in a folder or an object store, as file:///FOLDER or s3://BUCKET/PREFIX; credentials come from the environment.  "
    "[default: SQLite files in the workspace]",
)
@click.option("--regrid", is_flag=True, help="Replace the frames of an existing rendering to fit the current scene; everything is rendered again.")
@outlier_options
@style_option
@max_memory_option
@json_option
@workspace_option
def command(
    workspace: Workspace,
    scene: str,
    name: str,
    views: tuple[ViewAngles, ...],
    directions: int | None,
    keep_outliers: bool | None,
    cluster: int | None,
    style: "Rules | None",
    max_memory: int | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Create the rendering NAME of SCENE with its views, layers and resolution. Run map3d render afterwards.

    Look-at angle 0 looks north, 45 north-west, 90 west; the pitch is the angle below the horizon. The frame of each view is fixed now, so that
    later additions do not renumber any tile.
    """
    from map3d.renderings.create import RenderingRequest, create_rendering
    from map3d.renderings.outliers import choose_content
    from map3d.renderings.style import choose_style

    if views and (directions or options["pitch"]):
        raise BadRequest("give either --view, or --directions and --pitch")
    chosen = views or views_around(directions or 4, options.pop("pitch") or (45.0,))
    options.pop("pitch", None)
    request = RenderingRequest(scene, name, chosen, tile_px=int(options.pop("tile_size")), **options)
    with workspace.open_catalogue() as catalogue:
        request.check(catalogue)
        choose_content(catalogue, scene, keep_outliers, cluster)
        choose_style(catalogue, scene, style)
        built = build_with_progress(workspace, catalogue, scene, threads=usable_cores(), max_memory_bytes=max_memory)
        record = create_rendering(workspace, catalogue, request)
    if as_json:
        print_json({**asdict(record), "build": built})
        return
    levels, side = record.zmax + 1, record.tile_px << record.zmax
    shape = f"{plural(len(record.frames), 'view')}, {plural(levels, 'level')}"
    click.echo(f"rendering {name}: {shape}, {record.res_m:g} m per pixel, {side:,} px wide at the deepest level")
    click.echo(f"next: map3d estimate {name}, or map3d render {name}")
