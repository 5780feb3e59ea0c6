"""Checks the names of uploaded files: plain relative paths, so that textures stay beside their model and nothing leaves the folder."""

import unicodedata
from typing import Final

from map3d.errors import BadRequest

MAX_NAME_BYTES: Final = 255
"""Limit for the name of one file or folder, as in most file systems."""
MAX_PATH_BYTES: Final = 1_024
MAX_DEPTH: Final = 32
_FORBIDDEN: Final = frozenset('/\\:"<>|*?')
_CATEGORIES: Final = ("Cc", "Cs", "Co", "Cn", "Zl", "Zp")
_DIRECTION_CONTROLS: Final = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""They let a name look like another one."""


def check_path(path: str) -> str:
    """Returns the relative path with `/` between its names, in Unicode's composed form (NFC), as files write references. Raises BadRequest."""
    plain = unicodedata.normalize("NFC", path.replace("\\", "/"))
    names = plain.split("/")
    for name in names:
        if problem := _problem(name):
            raise BadRequest(f"file name {path[:80]!r}: {problem}; rename the file and upload it again")
    if len(names) > MAX_DEPTH or len(plain.encode()) > MAX_PATH_BYTES:
        found = f"{len(plain.encode())} bytes in {len(names)} levels"
        raise BadRequest(f"file name {path[:80]!r}…: has {found}, at most {MAX_PATH_BYTES} bytes in {MAX_DEPTH} levels are allowed")
    return plain


def _problem(name: str) -> str:
    if not name or name in (".", ".."):
        return "is not a relative path of plain names"
    if any(unicodedata.category(c) in _CATEGORIES or c in _DIRECTION_CONTROLS for c in name):
        return "has a character that cannot be printed"
    if set(name) & _FORBIDDEN:
        return f"has one of the characters {' '.join(sorted(_FORBIDDEN - {'/', chr(92)}))}"
    if name != name.strip() or name.endswith("."):
        return "has a name that begins or ends with a space, or ends with a dot"
    size = len(name.encode())
    return f"has a name of {size} bytes, at most {MAX_NAME_BYTES} are allowed" if size > MAX_NAME_BYTES else ""
