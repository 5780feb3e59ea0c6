"""Folders whose files contradict themselves or each other, a row each: what is drawn, and what is said. `pytest -s` prints the table."""

from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from tests.odd_cities.contradictions import Row, check
from tests.odd_cities.rows_of_files import FILES
from tests.odd_cities.rows_of_height import HEIGHT, SAME_OBJECTS
from tests.odd_cities.rows_of_images import IMAGES
from tests.odd_cities.rows_of_plan import PLAN

ROWS: list[Row] = [*PLAN, *HEIGHT, *FILES, *SAME_OBJECTS, *IMAGES]


@pytest.mark.parametrize("row", ROWS, ids=[row.name for row in ROWS])
def test_what_contradicts_is_drawn_in_its_place_or_said(tmp_path: Path, row: Row) -> None:
    print(f"\n{check(row, tmp_path)}")


def test_names_of_rows_tell_them_apart() -> None:
    assert len({row.name for row in ROWS}) == len(ROWS)
