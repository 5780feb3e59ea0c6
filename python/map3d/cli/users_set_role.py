"""map3d users set-role."""

import click

from map3d.catalogue import ROLES, Role, Workspace
from map3d.cli.account_options import opened_accounts
from map3d.cli.options import workspace_option


@click.command("set-role")
@click.argument("name")
@click.argument("role", type=click.Choice(ROLES))
@workspace_option
def command(workspace: Workspace, name: str, role: Role) -> None:
    """Set the role of the user NAME: viewer or editor."""
    with opened_accounts(workspace) as accounts:
        accounts.set_role(name, role)
    click.echo(f"{name} has the role {role}")
