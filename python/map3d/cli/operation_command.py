"""What the commands about one operation share: the argument, the options and how they print."""

from collections.abc import Callable, Sequence
from typing import Any

import click

from map3d.catalogue import Catalogue, Workspace
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json

Act = Callable[[Catalogue, str], tuple[Any, Sequence[str]]]
"""Takes an operation's id and returns the document of `--json` and the lines of text that stand in its place."""


def operation_command(name: str) -> Callable[[Act], click.Command]:
    """Makes a command of a function, whose docstring is the help."""

    def decorate(act: Act) -> click.Command:
        @click.command(name, help=act.__doc__)
        @click.argument("id")
        @json_option
        @workspace_option
        def command(workspace: Workspace, id: str, as_json: bool) -> None:
            catalogue = workspace.open_catalogue()
            try:
                document, lines = act(catalogue, id)
            finally:
                catalogue.close()
            if as_json:
                print_json(document)
            else:
                click.echo("\n".join(lines))

        return command

    return decorate
