"""Published folders that a removal leaves."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from map3d.catalogue import Workspace
from map3d.cli.output import size_text

if TYPE_CHECKING:
    from map3d.publish.published_folders import PublishedFolder


def print_folders_that_stay(workspace: Workspace, folders: Sequence["PublishedFolder"]) -> None:
    """Names the folders of the workspace that still hold what was removed."""
    for folder in folders:
        place = workspace.root / "published" / folder.name
        click.echo(f"published files of {folder.rendering} stay in {place}, {size_text(folder.bytes)}; delete the folder to take the map off the web")


def published_names(folders: Sequence["PublishedFolder"]) -> list[str]:
    return [folder.name for folder in folders]
