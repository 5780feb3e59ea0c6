"""map3d tokens remove."""

import click

from map3d.catalogue import Workspace
from map3d.cli.account_options import opened_accounts
from map3d.cli.options import workspace_option


@click.command("remove")
@click.argument("token", metavar="ID")
@workspace_option
def command(workspace: Workspace, token: str) -> None:
    """Remove the token with this ID; programs that send it are refused at once."""
    with opened_accounts(workspace) as accounts:
        accounts.catalogue.remove_token(token)
    click.echo(f"removed token {token}")
