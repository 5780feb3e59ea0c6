"""map3d users set-password."""

import click

from map3d.catalogue import Workspace
from map3d.cli.account_options import opened_accounts, read_password
from map3d.cli.options import workspace_option


@click.command("set-password")
@click.argument("name")
@workspace_option
def command(workspace: Workspace, name: str) -> None:
    """Set the password of the user NAME, and end the user's sessions. Asks for it, or reads it from standard input."""
    with opened_accounts(workspace) as accounts:
        accounts.catalogue.user(name)
        accounts.set_password(name, read_password(name))
    click.echo(f"set the password of {name}")
