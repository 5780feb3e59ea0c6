"""map3d tokens list."""

import click

from map3d.catalogue import Workspace
from map3d.cli.account_options import opened_accounts
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json, print_table


@click.command("list")
@click.argument("user", required=False)
@json_option
@workspace_option
def command(workspace: Workspace, user: str | None, as_json: bool) -> None:
    """List the tokens, or those of USER, by id; the tokens themselves are not stored."""
    with opened_accounts(workspace) as accounts:
        rows = [(token.id, token.user, token.role, token.title) for token in accounts.catalogue.tokens(user)]
    if as_json:
        print_json([dict(zip(("id", "user", "role", "title"), row, strict=True)) for row in rows])
    elif rows:
        print_table(("token", "user", "role", "title"), rows)
    else:
        click.echo("no tokens; create one with map3d tokens add USER --title TEXT", err=True)
