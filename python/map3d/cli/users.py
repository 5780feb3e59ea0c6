"""map3d users: a group of commands."""

import click

from map3d.accounts import check_user_name
from map3d.catalogue import ROLES, Role, Workspace
from map3d.cli.account_options import opened_accounts, read_password, role_option
from map3d.cli.confirmation import confirm, yes_option
from map3d.cli.options import json_option, workspace_option
from map3d.cli.ordered_group import OrderedGroup
from map3d.cli.output import plural, print_json, print_table


@click.group("users", cls=OrderedGroup)
def command() -> None:
    """Add, list and remove the users who may sign in to the web interface.

    A viewer sees scenes, imports and operations; an editor may also change and remove them. The maps themselves need no sign-in.
    """


@command.command("add")
@click.argument("name")
@role_option
@workspace_option
def add(workspace: Workspace, name: str, role: Role) -> None:
    """Add the user NAME. Asks for the password, or reads it from standard input."""
    check_user_name(name)
    with opened_accounts(workspace, create=True) as accounts:
        accounts.add_user(name, read_password(name), role)
    click.echo(f"added user {name} with the role {role}")


@command.command("list")
@json_option
@workspace_option
def list_users(workspace: Workspace, as_json: bool) -> None:
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


@command.command("set-password")
@click.argument("name")
@workspace_option
def set_password(workspace: Workspace, name: str) -> None:
    """Set the password of the user NAME, and end the user's sessions. Asks for it, or reads it from standard input."""
    with opened_accounts(workspace) as accounts:
        accounts.catalogue.user(name)
        accounts.set_password(name, read_password(name))
    click.echo(f"set the password of {name}")


@command.command("set-role")
@click.argument("name")
@click.argument("role", type=click.Choice(ROLES))
@workspace_option
def set_role(workspace: Workspace, name: str, role: Role) -> None:
    """Set the role of the user NAME: viewer or editor."""
    with opened_accounts(workspace) as accounts:
        accounts.set_role(name, role)
    click.echo(f"{name} has the role {role}")


@command.command("remove")
@click.argument("name")
@yes_option
@workspace_option
def remove(workspace: Workspace, name: str, yes: bool) -> None:
    """Remove the user NAME with all tokens, and end the user's sessions."""
    with opened_accounts(workspace) as accounts:
        accounts.catalogue.user(name)
        confirm(f"this removes the user {name} with {plural(len(accounts.catalogue.tokens(name)), 'token')}", yes=yes)
        accounts.catalogue.remove_user(name)
    click.echo(f"removed user {name}")
