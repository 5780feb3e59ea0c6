"""map3d tokens: a group of commands."""

import click

from map3d.catalogue import Role, Workspace
from map3d.cli.account_options import opened_accounts, role_option
from map3d.cli.options import json_option, workspace_option
from map3d.cli.ordered_group import OrderedGroup
from map3d.cli.output import print_json, print_table


@click.group("tokens", cls=OrderedGroup)
def command() -> None:
    """Add, list and remove the tokens with which programs act for a user.

    A program sends its token in the header Authorization: Bearer TOKEN.
    """


@command.command("add")
@click.argument("user")
@click.option("--title", required=True, help="What the token is for, e.g. 'nightly import'.")
@role_option
@workspace_option
def add(workspace: Workspace, user: str, title: str, role: Role) -> None:
    """Create a token with which a program acts for USER, and print it. It is not shown again."""
    with opened_accounts(workspace) as accounts:
        record, token = accounts.add_token(user, title, role)
    click.echo(f"created token {record.id} for {user}; it is not shown again:", err=True)
    click.echo(token)


@command.command("list")
@click.argument("user", required=False)
@json_option
@workspace_option
def list_tokens(workspace: Workspace, user: str | None, as_json: bool) -> None:
    """List the tokens, or those of USER, by id; the tokens themselves are not stored."""
    with opened_accounts(workspace) as accounts:
        rows = [(token.id, token.user, token.role, token.title) for token in accounts.catalogue.tokens(user)]
    if as_json:
        print_json([dict(zip(("id", "user", "role", "title"), row, strict=True)) for row in rows])
    elif rows:
        print_table(("token", "user", "role", "title"), rows)
    else:
        click.echo("no tokens; create one with map3d tokens add USER --title TEXT", err=True)


@command.command("remove")
@click.argument("token", metavar="ID")
@workspace_option
def remove(workspace: Workspace, token: str) -> None:
    """Remove the token with this ID; programs that send it are refused at once."""
    with opened_accounts(workspace) as accounts:
        accounts.catalogue.remove_token(token)
    click.echo(f"removed token {token}")
