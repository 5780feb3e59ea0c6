"""Hashes of passwords: scrypt, as werkzeug stores it."""

import threading
from functools import cache
from typing import Final

from werkzeug.security import check_password_hash, generate_password_hash

from map3d.errors import BadRequest

MIN_CHARACTERS: Final = 10
MAX_CHARACTERS: Final = 256
METHOD: Final = "scrypt"
HASHES_AT_ONCE: Final = 2
"""A hash takes 32 MiB and a tenth of a second; further ones wait."""

_turn: Final = threading.BoundedSemaphore(HASHES_AT_ONCE)


def hash_password(password: str, user: str = "") -> str:
    """Raises BadRequest for a password that is too short, too long or the user's name."""
    if not MIN_CHARACTERS <= len(password) <= MAX_CHARACTERS:
        raise BadRequest(f"the password has {len(password)} characters, expected {MIN_CHARACTERS} to {MAX_CHARACTERS}")
    if user and user.casefold() in password.casefold() and len(password) < len(user) + MIN_CHARACTERS:
        raise BadRequest("the password contains the user name; choose another one")
    with _turn:
        return generate_password_hash(password, method=METHOD)


def is_password(password: str, password_hash: str | None) -> bool:
    """Returns whether the password belongs to the hash. Without a hash it takes the same time, so that an answer's time names no user."""
    if len(password) > MAX_CHARACTERS:
        return False
    with _turn:
        return check_password_hash(password_hash or _dummy_hash(), password) and password_hash is not None


@cache
def _dummy_hash() -> str:
    return generate_password_hash("unknown", method=METHOD)
