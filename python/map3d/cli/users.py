"""map3d users: a group of commands."""

from typing import Final

import click

from map3d.cli.lazy_group import LazyGroup

COMMANDS: Final = {
    "add": "users_add",
    "list": "users_list",
    "set-password": "users_set_password",
    "set-role": "users_set_role",
    "remove": "users_remove",
}


@click.group("users", cls=LazyGroup, modules=COMMANDS)
def command() -> None:
    """Add, list and remove the users who may sign in to the web interface.

    A viewer sees scenes, imports and operations; an editor may also change and remove them. The maps themselves need no sign-in.
    """
