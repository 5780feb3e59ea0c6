"""map3d create-workspace."""

import os

import click

from map3d.catalogue import Workspace
from map3d.catalogue.catalogue_url import redact_url
from map3d.catalogue.open_catalogue import open_catalogue
from map3d.catalogue.workspace import CATALOGUE_VARIABLE
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json


@click.command("create-workspace")
@click.option("--catalogue", "url", metavar="URL", help="Catalogue for many nodes, e.g. mongodb://HOST/DATABASE.  [default: a file in the workspace]")
@json_option
@workspace_option
def command(workspace: Workspace, url: str | None, as_json: bool) -> None:
    """Create an empty workspace, and say where its catalogue is.

    The URL is stored in the workspace without a password. A URL with a password goes into the environment variable MAP3D_CATALOGUE, which has
    precedence.
    """
    workspace.create()
    if url is not None:
        workspace.check_catalogue_url(url)
        open_catalogue(os.environ.get(CATALOGUE_VARIABLE) or url).close()
        workspace.store_catalogue_url(url)
    workspace.open_catalogue().close()
    place = redact_url(workspace.find_catalogue_url() or str(workspace.catalogue_path))
    if as_json:
        print_json({"workspace": str(workspace.root), "catalogue": place})
    else:
        click.echo(f"created workspace {workspace.root} (catalogue: {place}); next: map3d create-scene NAME")
