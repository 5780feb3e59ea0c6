"""Messages: a code of spec/messages.json with the values that its text names. Text is made where it is read.

Nothing compares the text of a message: programs and pages look at the code.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from string import Formatter
from typing import Any, Final

from map3d import _core

FORMATS: Final = ("size", "distance", "duration")
"""Formats of values in texts, as in `{bytes:size}`; another one is the code of a counted noun, as in `{files:file}`."""


@dataclass(frozen=True)
class Message:
    """`values`: numbers, names, other messages, and lists of them."""

    code: str
    values: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.text("en")

    def text(self, language: str) -> str:
        """Returns the text in a language of `number_formats.STYLES`. A message with unknown text or values, of another version, is shown as data."""
        try:
            text = table()[self.code][language]
            chosen = text if isinstance(text, str) else text[0 if self.values["count"] == 1 else 1]
            return _Text(language).vformat(chosen, (), self.values)
        except KeyError:
            return " ".join([self.code, *(f"{name}={value}" for name, value in self.values.items())])

    @property
    def severity(self) -> str:
        return str(table().get(self.code, {}).get("severity", "note"))

    @property
    def document(self) -> dict[str, Any]:
        """The message as JSON."""
        return {"code": self.code, "values": {name: _plain(value) for name, value in self.values.items()}}

    @property
    def codes(self) -> set[str]:
        """Its code and those of the messages in it."""
        return {self.code, *(code for part in _parts(self.values) for code in part.codes)}

    def map_texts(self, change: Callable[[str], str]) -> "Message":
        """Returns the message with another text in place of each text among its values."""
        return Message(self.code, _map_texts(self.values, change))

    def named(self, name: str) -> dict[str, Any]:
        """Returns the English text as the member NAME of a JSON object, with NAME_code and NAME_values."""
        return {name: str(self), **{f"{name}_{part}": value for part, value in self.document.items()}}


def message(code: str, **values: Any) -> Message:
    """Returns a new message. Raises KeyError for a code that spec/messages.json does not have."""
    table()[code]
    return Message(code, values)


def verbatim(text: str) -> Message:
    """Returns a text that has no code, such as one of a library, of the operating system or of an older version of map3d."""
    return Message("verbatim", {"text": text})


def load_message(document: Any) -> Message:
    """Returns a message from JSON; what has no code is a text."""
    return _loaded(document) if isinstance(document, dict) else verbatim(str(document))


def dump_text(message: Message | None) -> str:
    """Returns the JSON that catalogues store as text, empty for None."""
    return "" if message is None else json.dumps(message.document, ensure_ascii=False)


def load_text(text: str | None) -> Message | None:
    """Reverses `dump_text`. What an older version of map3d stored is a text."""
    if not text:
        return None
    try:
        document = json.loads(text)
    except ValueError:
        return verbatim(text)
    return _loaded(document) if isinstance(document, dict) and set(document) == {"code", "values"} else verbatim(text)


@cache
def table() -> dict[str, dict[str, Any]]:
    """Returns spec/messages.json."""
    rows: dict[str, dict[str, Any]] = json.loads(_core.MESSAGES)
    return rows


class _Text(Formatter):
    """Puts values into a text, as the language writes them."""

    def __init__(self, language: str) -> None:
        self._language = language

    def format_field(self, value: Any, spec: str) -> str:
        from map3d import number_formats  # Babel takes a while to import

        if spec in FORMATS:
            return str(getattr(number_formats, spec)(value, self._language))
        if spec:
            return Message(spec, {"count": value}).text(self._language)
        if isinstance(value, list | tuple):
            return ", ".join(self.format_field(item, "") for item in value)
        if isinstance(value, Message):
            return value.text(self._language)
        return number_formats.number(value, self._language) if isinstance(value, int | float) else str(value)


def _parts(value: Any) -> Iterator[Message]:
    if isinstance(value, Message):
        yield value
    elif isinstance(value, Mapping | list | tuple):
        for item in value.values() if isinstance(value, Mapping) else value:
            yield from _parts(item)


def _map_texts(value: Any, change: Callable[[str], str]) -> Any:
    if isinstance(value, Message):
        return value.map_texts(change)
    if isinstance(value, Mapping):
        return {name: _map_texts(item, change) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_map_texts(item, change) for item in value]
    return change(value) if isinstance(value, str) else value


def _plain(value: Any) -> Any:
    if isinstance(value, Message):
        return value.document
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _loaded(value: Any) -> Any:
    if isinstance(value, dict):
        return Message(value["code"], {name: _loaded(item) for name, item in value["values"].items()})
    return [_loaded(item) for item in value] if isinstance(value, list) else value
