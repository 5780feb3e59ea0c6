"""map3d users add."""

import click

from map3d.catalogue import Role, Workspace
from map3d.cli.account_options import opened_accounts, read_password, role_option
from map3d.cli.options import workspace_option


@click.command("add")
@click.argument("name")
@role_option
@workspace_option
def command(workspace: Workspace, name: str, role: Role) -> None:
    """Add the user NAME. Asks for the password, or reads it from standard input."""
    from map3d.accounts import check_user_name

    check_user_name(name)
    with opened_accounts(workspace, create=True) as accounts:
        accounts.add_user(name, read_password(name), role)
    click.echo(f"added user {name} with the role {role}")
