"""Writes small XML documents with prefixes."""

from collections.abc import Mapping
from typing import Self
from xml.sax.saxutils import escape, quoteattr


class XmlWriter:
    """Elements are written as they come; `element` returns a context that closes it."""

    def __init__(self) -> None:
        self._lines = ['<?xml version="1.0" encoding="UTF-8"?>']
        self._open: list[str] = []

    def leaf(self, name: str, text: object = "", attributes: Mapping[str, str] | None = None) -> None:
        content = escape(_clean(str(text)))
        start = f"{name}{_attributes(attributes)}"
        self._lines.append(self._indent() + (f"<{start}>{content}</{name}>" if content else f"<{start}/>"))

    def element(self, name: str, attributes: Mapping[str, str] | None = None) -> Self:
        """Opens an element; the `with` statement closes it."""
        self._lines.append(f"{self._indent()}<{name}{_attributes(attributes)}>")
        self._open.append(name)
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        name = self._open.pop()
        self._lines.append(f"{self._indent()}</{name}>")

    def document(self) -> bytes:
        return ("\n".join(self._lines) + "\n").encode()

    def _indent(self) -> str:
        return "  " * len(self._open)


def _attributes(attributes: Mapping[str, str] | None) -> str:
    return "".join(f" {name}={quoteattr(_clean(value))}" for name, value in (attributes or {}).items())


def _clean(text: str) -> str:
    """Replaces characters that XML cannot hold."""
    return "".join(character if character.isprintable() else " " for character in text)
