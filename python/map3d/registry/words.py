"""The words of a text, as the search index compares them (spec/manifest.md)."""

import re
import sys
import unicodedata
from functools import cache
from typing import Final

_ASCII_WORD: Final = re.compile(r"[0-9a-z]+")
_WORD: Final = re.compile(r"[^\W_]+")


def search_words(text: str) -> list[str]:
    """Returns the words of a text: letters and digits, in lower case without accents; `Straße` becomes `strasse`."""
    if text.isascii():
        return _ASCII_WORD.findall(text.lower())
    return _WORD.findall(unicodedata.normalize("NFD", text.lower().replace("ß", "ss")).translate(_marks()))


@cache
def _marks() -> dict[int, None]:
    """Returns all combining marks, for `str.translate`."""
    return {code: None for code in range(sys.maxunicode + 1) if unicodedata.category(chr(code))[0] == "M"}
