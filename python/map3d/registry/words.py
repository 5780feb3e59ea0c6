"""The words of a text, as the search index compares them (spec/manifest.md)."""

import re
import unicodedata
from typing import Final

_ASCII_WORD: Final = re.compile(r"[0-9a-z]+")
_WORD: Final = re.compile(r"[^\W_]+")


def search_words(text: str) -> list[str]:
    """Returns the words of a text: letters and digits, in lower case without accents; `Straße` becomes `strasse`."""
    if text.isascii():
        return _ASCII_WORD.findall(text.lower())
    return _WORD.findall(unicodedata.normalize("NFD", text.lower().replace("ß", "ss")).translate(_MARKS))


class _Marks(dict[int, int | None]):
    """Removes combining marks in `str.translate`. Looks up each character once, when a text has it."""

    def __missing__(self, code: int) -> int | None:
        self[code] = None if unicodedata.category(chr(code))[0] == "M" else code
        return self[code]


_MARKS: Final = _Marks()
