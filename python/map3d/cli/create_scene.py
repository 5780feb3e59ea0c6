"""map3d create-scene."""

from typing import TYPE_CHECKING

import click

from map3d.catalogue import Workspace
from map3d.cli.options import json_option, outlier_options, style_option, workspace_option
from map3d.cli.output import print_json

if TYPE_CHECKING:
    from map3d.renderings.style import Rules

SWITCHES = {
    "merge-vertices": "merge duplicate vertices",
    "merge-faces": "drop duplicate faces of the same object and material",
    "drop-degenerate": "drop triangles with zero area",
    "merge-materials": "merge equal materials",
    "drop-untextured": "drop faces without a texture",
}
_ON = ("merge-vertices", "merge-faces", "drop-degenerate", "merge-materials")


def _switches(command: click.decorators.FC) -> click.decorators.FC:
    for name, effect in reversed(SWITCHES.items()):
        command = click.option(f"--{name}/--no-{name}", default=name in _ON, show_default=True, help=f"Build step: {effect}.")(command)
    return command


@click.command("create-scene")
@click.argument("name")
@click.option("--crs", help="Coordinate system, e.g. EPSG:25832; 'local' for local metres.  [default: that of the first file]")
@click.option("--title", default="", help="Display title.")
@click.option("--attribution", default="", help="Attribution text.")
@click.option(
    "--ground-plane",
    type=click.Choice(["auto", "on", "off"]),
    default="auto",
    show_default=True,
    help="Ground plane; auto adds it to scenes without terrain.",
)
@click.option(
    "--files",
    metavar="URL",
    help="Share the built scene with other nodes: upload its files to a folder or an object store, as file:///FOLDER or s3://BUCKET/PREFIX.",
)
@outlier_options
@style_option
@_switches
@json_option
@workspace_option
def command(
    workspace: Workspace,
    name: str,
    crs: str | None,
    title: str,
    attribution: str,
    ground_plane: str,
    files: str | None,
    keep_outliers: bool | None,
    cluster: int | None,
    style: "Rules | None",
    as_json: bool,
    **switches: bool,
) -> None:
    """Create an empty scene NAME, and the workspace if it does not exist."""
    from map3d.renderings.create_scene import SceneRequest, create_scene

    request = SceneRequest(name, title, attribution, crs, ground_plane, files, switches, bool(keep_outliers), cluster or 0, style or [])
    request.check()
    with workspace.create().open_catalogue() as catalogue:
        scene = create_scene(workspace, catalogue, request)
    if as_json:
        print_json(scene)
    else:
        system = "that of the first file" if scene.crs is None else scene.crs.name
        click.echo(f"created scene {name} in {workspace.root} (coordinate system: {system}); next: map3d add-files {name} FILE…")
