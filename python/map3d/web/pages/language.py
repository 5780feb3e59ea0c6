"""The language of a page."""

from pathlib import Path
from typing import Final

from map3d.web.http.accepting import accepted
from map3d.web.http.current import request

TRANSLATIONS: Final = Path(__file__).parents[1] / "translations"
LANGUAGES: Final = ("en", *sorted(path.stem for path in TRANSLATIONS.glob("*.json")))


def language() -> str:
    """Returns the first language of the browser that pages are written in, else English."""
    requested = (name[:2] for name in accepted(request().headers.get("accept-language", "")))
    return next((name for name in requested if name in LANGUAGES), "en")
