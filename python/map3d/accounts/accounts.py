"""Users, their passwords and roles, and the tokens of their programs."""

import hashlib
import re
import secrets
from dataclasses import dataclass, replace
from typing import Final

from map3d.accounts.passwords import hash_password, is_password
from map3d.catalogue import ROLES, Catalogue, Role, TokenRecord, UserRecord
from map3d.errors import BadName, BadRequest, NotFound

TOKEN_PREFIX: Final = "map3d_"
"""Tokens begin with it, so that scanners find those that were published by mistake."""
MAX_TITLE: Final = 200

_USER_NAME: Final = re.compile(r"[a-z0-9][a-z0-9._@+-]{0,63}", re.ASCII)


@dataclass(frozen=True)
class Identity:
    """Who asks: a signed-in user, or a program with a token, named by its id."""

    user: str
    role: Role
    token: str | None = None

    def may(self, role: Role) -> bool:
        """Returns whether the identity has this role or a higher one."""
        return ROLES.index(self.role) >= ROLES.index(role)


def check_user_name(name: str) -> str:
    """Returns the name if a user may have it; raises BadName. Mail addresses in lower case are names."""
    if not _USER_NAME.fullmatch(name):
        raise BadName(f"user name {name!r}: use 1 to 64 of a-z, 0-9 and .-_@+, beginning with a letter or digit")
    return name


class Accounts:
    """The accounts of a catalogue. Safe to share between threads."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.catalogue = catalogue

    def exist(self) -> bool:
        """Returns whether there is any user: without one, nothing can be changed through the web."""
        return bool(self.catalogue.users())

    def add_user(self, name: str, password: str, role: Role) -> None:
        """Raises BadName, BadRequest (password), AlreadyExists."""
        self.catalogue.create_user(UserRecord(check_user_name(name), hash_password(password, name), role))

    def set_password(self, name: str, password: str) -> None:
        """Ends the user's sessions. Raises NotFound, BadRequest."""
        user = self.catalogue.user(name)
        self.catalogue.update_user(replace(user, password_hash=hash_password(password, name)))

    def set_role(self, name: str, role: Role) -> None:
        """Raises NotFound."""
        self.catalogue.update_user(replace(self.catalogue.user(name), role=role))

    def check_password(self, name: str, password: str) -> UserRecord | None:
        """Returns the user, None for an unknown name or a wrong password, which take the same time."""
        user = self.find_user(name)
        return user if is_password(password, None if user is None else user.password_hash) else None

    def find_user(self, name: str) -> UserRecord | None:
        try:
            return self.catalogue.user(name) if _USER_NAME.fullmatch(name) else None
        except NotFound:
            return None

    def add_token(self, user: str, title: str, role: Role) -> tuple[TokenRecord, str]:
        """Returns the record and the token itself, which is not stored. Raises NotFound, BadRequest for a title that is empty or too long."""
        if not 1 <= len(title.strip()) <= MAX_TITLE:
            raise BadRequest(f"the title of the token has {len(title.strip())} characters, expected 1 to {MAX_TITLE}: say what it is for")
        text = TOKEN_PREFIX + secrets.token_urlsafe(32)
        record = TokenRecord(secrets.token_hex(4), user, title.strip(), role, _digest(text))
        self.catalogue.create_token(record)
        return record, text

    def find_token(self, text: str) -> Identity | None:
        """Returns whom the token stands for, with the lesser of its role and the user's; None for an unknown token."""
        record = self.catalogue.find_token(_digest(text)) if text.startswith(TOKEN_PREFIX) else None
        user = None if record is None else self.find_user(record.user)
        return None if record is None or user is None else Identity(user.name, min(record.role, user.role, key=ROLES.index), record.id)


def _digest(token: str) -> str:
    """A token has 256 random bits, so that a fast hash is enough."""
    return hashlib.sha256(token.encode("utf-8", "replace")).hexdigest()
