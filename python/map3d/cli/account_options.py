"""Arguments and options of the commands for accounts."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import click

from map3d.accounts import Accounts
from map3d.catalogue import ROLES, Workspace
from map3d.errors import BadRequest

Command = TypeVar("Command", bound=Callable[..., Any])


def role_option(command: Command) -> Command:
    return click.option("--role", type=click.Choice(ROLES), default="viewer", show_default=True, help="What it allows.")(command)


@contextmanager
def opened_accounts(workspace: Workspace, *, create: bool = False) -> Iterator[Accounts]:
    """Opens the accounts of a workspace, which is created if `create` is set."""
    with (workspace.create() if create else workspace).open_catalogue() as catalogue:
        yield Accounts(catalogue)


def read_password(user: str) -> str:
    """Asks for a password twice at the terminal, or reads the first line of standard input. Raises BadRequest for an empty one."""
    if sys.stdin.isatty():
        password: str = click.prompt(f"Password for {user}", hide_input=True, confirmation_prompt=True, err=True)
    else:
        password = sys.stdin.readline().rstrip("\r\n")
    if not password:
        raise BadRequest("the password is empty; type it at a terminal, or send it on standard input")
    return password
