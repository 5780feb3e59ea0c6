"""map3d tokens: a group of commands."""

from typing import Final

import click

from map3d.cli.lazy_group import LazyGroup

COMMANDS: Final = {"add": "tokens_add", "list": "tokens_list", "remove": "tokens_remove"}


@click.group("tokens", cls=LazyGroup, modules=COMMANDS)
def command() -> None:
    """Add, list and remove the tokens with which programs act for a user.

    A program sends its token in the header Authorization: Bearer TOKEN.
    """
