"""map3d demo."""

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import click

from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.cli.from_request import request_option
from map3d.errors import BadRequest
from map3d.requests import Site
from map3d.types import DEFAULT_DATA, LAYERS_BY_DATA, DataEncoding

TOWN: Final = ("--buildings", "120", "--seed", "7")
RES_M: Final = "0.15"
VIEWS: Final = (*(f"{look_at}/45" for look_at in range(0, 360, 45)), "0/90")
"""Eight directions, and straight down."""
OPTIONS: Final = ("--date", "2026-06-21", "--small", *(f"--view={view}" for view in VIEWS))
"""Light takes most of the time, so that small tiles cost a tenth more."""
LIGHT: Final = ("sun16", "ao")
"""Layers besides the usual ones: the shadows of a summer's day, and ambient occlusion."""
TITLE: Final = ("--title", "A generated town")
NAME: Final = "demo"
SCENE: Final = "town"


@click.command("demo")
@click.option("--folder", type=click.Path(path_type=Path, file_okay=False), default=Path("map3d-demo"), show_default=True, help="Output folder.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, show_default="a free port", help="Port to listen on.")
@click.option("--no-serve", is_flag=True, help="Stop after rendering.")
@request_option(Site, "data")
def command(folder: Path, port: int, no_serve: bool, data: DataEncoding | None) -> None:
    """Generate a town, render it, serve it and print the address of its map.

    You can stop it at any time; re-run it to resume.
    """
    workspace = Workspace(folder / "workspace").create()
    for title, arguments in remaining_steps(workspace, folder / "town", data):
        _run(title, arguments)
    if no_serve:
        click.echo(f"next: map3d serve {NAME} --workspace {workspace.root}")
    else:
        _run("serving the map; press Ctrl-C to stop", ["serve", NAME, "--port", str(port), "--workspace", str(workspace.root)])


def remaining_steps(workspace: Workspace, files: Path, data: DataEncoding | None = None) -> Iterator[tuple[str, list[str]]]:
    """Yields (description, command line) of each step up to rendering, without the steps that an earlier run has completed."""
    where = ["--workspace", str(workspace.root)]
    yield f"generating a town in {files}", ["make-town", "-o", str(files), *TOWN]
    with workspace.open_catalogue() as catalogue:
        assets = {scene.name: catalogue.assets(scene.name) for scene in catalogue.scenes()}
        renderings = {rendering.name: {layer.kind for layer in rendering.layers} for rendering in catalogue.renderings()}
    if data is not None and NAME in renderings and not renderings[NAME] >= set(LAYERS_BY_DATA[data]):
        raise BadRequest(f"the demo in {files.parent} was rendered with other data than --data {data}; name another --folder, or remove this one")
    if SCENE not in assets:
        yield "creating a scene", ["create-scene", SCENE, *TITLE, *where]
    if not assets.get(SCENE):
        yield "importing the town's files", ["add-files", SCENE, str(files), *where]
    if NAME not in renderings:
        layers = ["--layers", ",".join((*LAYERS_BY_DATA[data or DEFAULT_DATA], *LIGHT))]
        yield "building the scene and creating a rendering", ["create-rendering", SCENE, NAME, "--res", RES_M, *OPTIONS, *layers, *TITLE, *where]
    yield "rendering the tiles", ["render", NAME, *where]


def _run(title: str, arguments: list[str]) -> None:
    click.echo(f"== {title}: map3d {shlex.join(arguments)}")
    status = run(arguments)
    if status:
        raise click.exceptions.Exit(status)
