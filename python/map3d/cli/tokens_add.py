"""map3d tokens add."""

import click

from map3d.catalogue import Role, Workspace
from map3d.cli.account_options import opened_accounts, role_option
from map3d.cli.options import workspace_option


@click.command("add")
@click.argument("user")
@click.option("--title", required=True, help="What the token is for, e.g. 'nightly import'.")
@role_option
@workspace_option
def command(workspace: Workspace, user: str, title: str, role: Role) -> None:
    """Create a token with which a program acts for USER, and print it. It is not shown again."""
    with opened_accounts(workspace) as accounts:
        record, token = accounts.add_token(user, title, role)
    click.echo(f"created token {record.id} for {user}; it is not shown again:", err=True)
    click.echo(token)
