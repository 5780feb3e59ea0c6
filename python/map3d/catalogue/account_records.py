"""The records of accounts: users and the tokens of their programs. Passwords and tokens are stored as hashes only (room `accounts`)."""

from dataclasses import dataclass
from typing import Any, Final, Literal

Role = Literal["viewer", "editor"]
ROLES: Final[tuple[Role, ...]] = ("viewer", "editor")
"""In rising order: an editor may do everything that a viewer may."""


@dataclass(frozen=True)
class UserRecord:
    """A person who may sign in. `created_s`: seconds since 1970 on the database's clock; the catalogue sets it."""

    name: str
    password_hash: str
    role: Role
    created_s: float = 0.0


@dataclass(frozen=True)
class TokenRecord:
    """A token with which a program acts for `user`, with at most `role`. `digest`: SHA-256 of the token, hex; `title`: what the token is for."""

    id: str
    user: str
    title: str
    role: Role
    digest: str
    created_s: float = 0.0


def load_user(row: Any) -> UserRecord:
    return UserRecord(row["name"], row["password_hash"], row["role"], row["created_s"])


def load_token(row: Any) -> TokenRecord:
    return TokenRecord(row["id"], row["user"], row["title"], row["role"], row["digest"], row["created_s"])
