"""map3d users remove."""

import click

from map3d.catalogue import Workspace
from map3d.cli.account_options import opened_accounts
from map3d.cli.confirmation import confirm, yes_option
from map3d.cli.options import workspace_option
from map3d.cli.output import plural


@click.command("remove")
@click.argument("name")
@yes_option
@workspace_option
def command(workspace: Workspace, name: str, yes: bool) -> None:
    """Remove the user NAME with all tokens, and end the user's sessions."""
    with opened_accounts(workspace) as accounts:
        accounts.catalogue.user(name)
        confirm(f"this removes the user {name} with {plural(len(accounts.catalogue.tokens(name)), 'token')}", yes=yes)
        accounts.catalogue.remove_user(name)
    click.echo(f"removed user {name}")
