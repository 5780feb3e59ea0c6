"""The language of a page."""

from typing import Final

from flask import request

LANGUAGES: Final = ("en", "de")


def language() -> str:
    """Returns the first language of the browser that pages are written in, else English."""
    requested = (name[:2].lower() for name in request.accept_languages.values())
    return next((name for name in requested if name in LANGUAGES), "en")
