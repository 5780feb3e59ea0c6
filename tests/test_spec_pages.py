"""The pages of spec/ begin with their changes, their tables have short cells, and the fields of a binary layout follow each other without gaps."""

import re
from itertools import pairwise
from math import prod
from pathlib import Path

import pytest

SPEC = Path(__file__).parents[1] / "spec"
PAGES = sorted(SPEC.glob("*.md"))
MAX_CELL = 300
CELLS = re.compile(r"(?<!\\)\|")
LAYOUT = ["offset", "size", "type", "meaning"]
TYPE = re.compile(r"[uif](8|16|32|64)((?:\[\d+\])*)")

each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)


def tables(page: Path) -> list[list[list[str]]]:
    """Returns the tables of a page as rows of cells; the first row is the header."""
    blocks = re.findall(r"(?:^\|.*\n)+", page.read_text("utf-8"), re.MULTILINE)
    return [[[cell.strip() for cell in CELLS.split(line)[1:-1]] for line in block.splitlines()] for block in blocks]


@each_page
def test_a_page_begins_with_its_changes(page: Path) -> None:
    headings = re.findall(r"^## (.*)", page.read_text("utf-8"), re.MULTILINE)
    assert headings[0] == "Changes"
    dates = [cell for row in tables(page)[0] for cell in row if re.fullmatch(r"\d{4}-\d\d-\d\d", cell)]
    assert dates


@each_page
def test_cells_are_short(page: Path) -> None:
    assert [cell for table in tables(page) for row in table for cell in row if len(cell) > MAX_CELL] == []


@each_page
def test_rows_have_as_many_cells_as_their_header(page: Path) -> None:
    assert [row for table in tables(page) for row in table if len(row) != len(table[0])] == []


def layouts(page: Path) -> list[list[list[str]]]:
    return [table[2:] for table in tables(page) if table[0] == LAYOUT]


@each_page
def test_fields_of_a_layout_follow_each_other(page: Path) -> None:
    for fields in layouts(page):
        for (offset, size, *_), (following, *_) in pairwise(fields):
            if offset.isdigit() and size.isdigit():
                assert following == str(int(offset) + int(size)), fields


@each_page
def test_fields_are_as_long_as_their_types(page: Path) -> None:
    for _, size, kind, meaning in (field for fields in layouts(page) for field in fields):
        if found := TYPE.fullmatch(kind):
            assert size == str(int(found[1]) // 8 * prod(int(n) for n in re.findall(r"\d+", found[2]))), meaning


def test_every_binary_layout_has_a_table() -> None:
    text = "".join(page.read_text("utf-8") for page in PAGES)
    magics = set(re.findall(r"M3D[A-Z]?\b", text)) - {"M3D"}
    in_tables = {magic for page in PAGES for fields in layouts(page) for magic in re.findall(r"M3D[A-Z]", fields[0][3])}
    assert in_tables == magics == {"M3DA", "M3DB", "M3DC", "M3DG", "M3DH", "M3DI", "M3DO", "M3DT", "M3DV"}
