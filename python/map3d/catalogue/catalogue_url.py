"""URLs of catalogues, whose passwords are never stored or printed."""

import re
from typing import Final

_USER_INFO: Final = re.compile(r"^([A-Za-z0-9+.-]+://)([^:@]*):(.*)@")
"""Everything up to the last @, so that a password that should have been escaped is recognised too."""
_SECRET: Final = re.compile(r"(?i)([?&;][a-z]*(?:password|properties|token|secret)[a-z]*=)[^&;]*")


def redact_url(url: str) -> str:
    """Returns the URL with *** instead of passwords."""
    return _SECRET.sub(r"\1***", _USER_INFO.sub(r"\1\2:***@", url))


def has_password(url: str) -> bool:
    return redact_url(url) != url
