"""map3d users list."""

import click

from map3d.catalogue import Workspace
from map3d.cli.account_options import opened_accounts
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json, print_table


@click.command("list")
@json_option
@workspace_option
def command(workspace: Workspace, as_json: bool) -> None:
    """List the users with their roles and numbers of tokens."""
    with opened_accounts(workspace) as accounts:
        tokens = [token.user for token in accounts.catalogue.tokens()]
        rows = [(user.name, user.role, tokens.count(user.name)) for user in accounts.catalogue.users()]
    if as_json:
        print_json([dict(zip(("name", "role", "tokens"), row, strict=True)) for row in rows])
    elif rows:
        print_table(("user", "role", "tokens"), rows)
    else:
        click.echo("no users; add one with map3d users add NAME --role editor", err=True)
