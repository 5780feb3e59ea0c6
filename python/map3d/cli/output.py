"""Output: text and tables for people, one JSON document for programs."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from map3d.ingest.findings import Finding
from map3d.messages import Message
from map3d.quantities import names_text, plural, size_text, time_text

__all__ = ["console", "counts_text", "names_text", "plural", "print_json", "print_table", "size_text", "table", "time_text"]


def console() -> Console:
    """Returns the console for progress and messages: standard error, so that standard output can be piped."""
    return Console(stderr=True, highlight=False, soft_wrap=True)


def print_json(value: Any) -> None:
    click.echo(json.dumps(value, ensure_ascii=False, indent=1, default=_plain))


def print_table(columns: Sequence[str], rows: Iterable[Sequence[Any]], title: str | None = None) -> None:
    """Prints a table; columns of numbers are right-aligned."""
    Console(highlight=False, width=None if Console().is_terminal else 160).print(table(columns, rows, title))


def table(columns: Sequence[str], rows: Iterable[Sequence[Any]], title: str | None = None) -> Table:
    listed = [list(row) for row in rows]
    made = Table(*columns, title=title, title_justify="left", box=None, pad_edge=False, header_style="bold")
    for index, column in enumerate(made.columns):
        if listed and all(isinstance(row[index], int | float) or row[index] is None for row in listed):
            column.justify = "right"
    for row in listed:
        made.add_row(*(_text(cell) for cell in row))
    return made


def counts_text(counts: Mapping[Any, int]) -> str:
    """Returns the counts as in `12 done, 3 todo`, without zeros."""
    return ", ".join(f"{count:,} {name}" for name, count in counts.items() if count) or "none"


def _text(cell: Any) -> str:
    if cell is None:
        return "–"
    return f"{cell:,}" if isinstance(cell, int) and not isinstance(cell, bool) else str(cell)


def _plain(value: Any) -> Any:
    if isinstance(value, Message):
        return {**value.document, "text": str(value)}
    if isinstance(value, Finding):
        return value.document
    return _members(value) if is_dataclass(value) and not isinstance(value, type) else str(value)


def _members(value: Any) -> dict[str, Any]:
    """Returns the fields of a record; a message is its English text, with its code and values beside it."""
    members: dict[str, Any] = {}
    for item in fields(value):
        part = getattr(value, item.name)
        members |= part.named(item.name) if isinstance(part, Message) else {item.name: part}
    return members
