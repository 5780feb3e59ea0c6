"""Hashes of passwords: `scrypt:N:r:p$salt$hash`, the hash in hex."""

import hashlib
import hmac
import secrets
import threading
from functools import cache
from typing import Final

from map3d.errors import BadRequest

MIN_CHARACTERS: Final = 10
MAX_CHARACTERS: Final = 256
METHOD: Final = "scrypt:32768:8:1"
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
        return _make_hash(password, METHOD, secrets.token_urlsafe(12))


def is_password(password: str, password_hash: str | None) -> bool:
    """Returns whether the password belongs to the hash. Without a hash it takes the same time, so that an answer's time names no user."""
    if len(password) > MAX_CHARACTERS:
        return False
    with _turn:
        expected = password_hash or _dummy_hash()
        return hmac.compare_digest(_make_hash(password, *expected.split("$")[:2]), expected) and password_hash is not None


@cache
def _dummy_hash() -> str:
    return _make_hash("unknown", METHOD, "salt")


def _make_hash(password: str, method: str, salt: str) -> str:
    n, r, p = map(int, method.split(":")[1:])
    digest = hashlib.scrypt(password.encode(), salt=salt.encode(), n=n, r=r, p=p, maxmem=132 * n * r * p)
    return f"{method}${salt}${digest.hex()}"
