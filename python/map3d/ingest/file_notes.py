"""What is said of files of a folder that are no documents of their own: they are used by others, copies of others, or not read."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from map3d.messages import Message, message
from map3d.quantities import names_text

FileNote = tuple[str, Message]
"""(file, what it is)."""

_USED: Final = ("used-as-texture", "used-as-geometry", "used-as-code-list", "used-as-appearance", "used-as-place", "used-beside")
_NO_CONTENT: Final = ("without-city-data", "not-used", "left-hidden", "left-own-folder")
_LEFT_OUT: Final = ("left-same-content", "left-backup", "left-link", "left-archive-without-files")
_LINES: Final[Mapping[str, str]] = {
    "heights-alone": "files-read-as-terrain",
    **dict.fromkeys(_USED, "files-used"),
    **dict.fromkeys((*_LEFT_OUT, *_NO_CONTENT), "files-left-out"),
}
_TAGS: Final = {"files-ignored": "ignored", "files-used": "used", "files-left-out": "left out", "files-read-as-terrain": "terrain"}
HEIGHTS_ALONE: Final = "heights-alone"
"""Code of what a document is that has rasters of reliefs and nothing to draw."""


def unread(content: str) -> Message:
    """Returns what a file is that map3d does not read."""
    return message("format-ignored", content=content)


def tag(note: Message) -> str:
    """Returns the word for what happens to a file: used, left out, ignored, terrain."""
    return _TAGS[_line_code(note)]


def is_used(note: Message) -> bool:
    """Whether files that are read use the file."""
    return note.code in _USED


def is_decided(note: Message) -> bool:
    """Whether the file is there and readable, and is no document since another file uses it or has its content."""
    return note.code in (*_USED, *_LEFT_OUT)


def note_lines(notes: Iterable[FileNote]) -> Iterator[Message]:
    """Yields a line for each kind of file."""
    kinds: dict[tuple[str, str], _Kind] = {}
    for file, note in notes:
        kind = kinds.setdefault((note.code, str(note.values.get("content", note.values.get("text", "")))), _Kind(note))
        kind.files.append(file)
        if "of" in note.values:
            kind.others[str(note.values["of"])] = None
    yield from sorted((kind.line for kind in kinds.values()), key=lambda line: (line.code, str(line)))


@dataclass
class _Kind:
    """Files of one kind, and those that use them or have their content."""

    note: Message
    files: list[str] = field(default_factory=list)
    others: dict[str, None] = field(default_factory=dict)

    @property
    def line(self) -> Message:
        reason = message(self.note.code, of=names_text(list(self.others), 3)) if self.others else self.note
        return message(_line_code(self.note), files=names_text(self.files), reason=reason)


def _line_code(note: Message) -> str:
    return _LINES.get(note.code, "files-ignored")
