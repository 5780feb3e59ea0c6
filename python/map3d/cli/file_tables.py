"""What files hold, as a table and as lines: for `map3d inspect` and `map3d site`."""

from collections.abc import Iterator, Sequence
from typing import Final

import click

from map3d.cli.output import plural, print_table
from map3d.registry import ObjectKind
from map3d.scenes.file_contents import FileContents, file_label, findings_of
from map3d.scenes.outlier_lines import extent_text

MAX_ROWS: Final = 20
MAX_KINDS: Final = 8
MAX_FINDINGS: Final = 20


def print_files(files: Sequence[FileContents]) -> None:
    """Prints a row per file. The columns `left out` and `skipped` are there if something was."""
    columns = ["file", "format", "objects", "triangles", "textures", "extent", "place"]
    rows = [_row(file) for file in files[:MAX_ROWS]]
    for name, cells in (("skipped", [file.skipped or "" for file in files]), ("left out", [_outside_text(file) for file in files])):
        if any(cells):
            columns.append(name)
            rows = [[*row, cell] for row, cell in zip(rows, cells[:MAX_ROWS], strict=True)]
    print_table(columns, rows)
    if len(files) > MAX_ROWS:
        click.echo(f"and {plural(len(files) - MAX_ROWS, 'more file')}")


def kinds_text(kinds: Sequence[ObjectKind]) -> str:
    """Returns e.g. "34: 32 Building (LoD 2), 2 Road (no geometry)"."""
    parts = [_kind_text(kind) for kind in kinds[:MAX_KINDS]]
    if len(kinds) > MAX_KINDS:
        parts.append(f"{sum(kind.count for kind in kinds[MAX_KINDS:]):,} of other kinds")
    total = f"{sum(kind.count for kind in kinds):,}"
    return f"{total}: {', '.join(parts)}" if parts else total


def textures_text(file: FileContents) -> str:
    """Returns e.g. "12, 3 missing: a.jpg, b.jpg and 1 more"; "none" for a document without any."""
    if file.textures is None:
        return "none" if file.rasters is None else ""
    text = f"{file.textures.images:,}"
    if not file.textures.missing:
        return text
    names = [cut(name) for name in file.textures.examples]
    more = file.textures.missing - len(names)
    return f"{text}, {file.textures.missing:,} missing: {', '.join(names)}" + (f" and {more:,} more" if more > 0 else "")


def findings_lines(files: Sequence[FileContents]) -> Iterator[str]:
    """Yields a line for each kind of defect, with an example."""
    findings = findings_of(files)
    yield from (cut(str(found), 400) for found in findings[:MAX_FINDINGS])
    if len(findings) > MAX_FINDINGS:
        yield f"{len(findings) - MAX_FINDINGS} more kinds of defects; --json lists them"


def cut(text: str, limit: int = 80) -> str:
    """Returns a name as one short line."""
    line = " ".join(text.split())
    return line if len(line) <= limit else line[: limit - 1] + "…"


def _row(file: FileContents) -> list[str | int | None]:
    missing = "" if file.textures is None or not file.textures.missing else f", {file.textures.missing:,} missing"
    textures = "" if file.textures is None else f"{file.textures.images:,}{missing}"
    extent = "nothing" if file.box is None else extent_text(file.box)
    return [cut(file_label(file)), file.format, file.objects, file.triangles, textures, extent, file.place or ""]


def _outside_text(file: FileContents) -> str:
    return plural(file.outside, "triangle") if file.outside else ""


def _kind_text(kind: ObjectKind) -> str:
    notes = [] if kind.lod is None else [f"LoD {kind.lod}"]
    if kind.drawn < kind.count:
        notes.append("no geometry" if not kind.drawn else f"{kind.count - kind.drawn:,} without geometry")
    return f"{kind.count:,} {kind.kind.replace('_', ' ')}" + (f" ({', '.join(notes)})" if notes else "")
