"""Transparency written as opacity: walls are drawn, and the decision is said in one line."""

import json
from pathlib import Path

import pytest

from tests.cli.towns import Run
from tests.odd_cities.appearances import add_transparency
from tests.odd_cities.towns import write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

FACES = 16 * 6
OPACITY_LINE = (
    "The transparency of the file is read as opacity, since all would be invisible otherwise. "
    "Example: town: 1 of 2 materials would be invisible, and none opaque; --transparency as-is draws them so\n"
)


def write_town(folder: Path, walls: str, roofs: str) -> Path:
    """Writes a town whose walls and roofs have these transparencies."""
    return add_transparency(write_citygml(folder / "town.gml", None, lambda corners: corners), walls, roofs)


@pytest.mark.parametrize(
    ("walls", "roofs", "option", "drawn", "said"),
    [
        ("1.0", "0.5", "auto", FACES, "1 of 2 materials would be invisible"),
        ("1.0", "0.5", "as-is", FACES // 3, "64; --transparency inverted draws them"),
        ("1.0", "0.0", "auto", FACES // 3, "64; --transparency inverted draws them"),
        ("1.0", "0.0", "inverted", 2 * FACES // 3, "32; --transparency as-is draws them"),
        ("0.0", "0.5", "auto", FACES, None),
    ],
)
def test_transparency_is_decided_for_each_file(tmp_path: Path, run: Run, walls: str, roofs: str, option: str, drawn: int, said: str | None) -> None:
    write_town(tmp_path, walls, roofs)
    assert run("create-scene", "town")[0] == 0
    status, out, _ = run("add-files", "town", "town.gml", "--crs", "local", "--transparency", option, "--json")
    assert status == 0
    (imported,) = json.loads(out)["imported"]
    assert imported["triangles"] == 2 * drawn
    codes = ("transparency-read-as-opacity", "transparent-surfaces-not-drawn")
    about = [found for found in imported["report"]["findings"] if found["code"] in codes]
    assert [warning["example"] for warning in about] == ([] if said is None else [about[0]["example"]])
    assert said is None or about[0]["example"].startswith(said)


def test_site_says_how_it_read_transparency(tmp_path: Path, run: Run) -> None:
    write_town(tmp_path / "city", "1.0", "0.5")
    options = ("-o", "site", "--res", "1", "--view", "0-45", "--workers", "1", "--crs", "local")
    status, out, err = run("site", "city", *options)
    assert status == 0, err
    assert OPACITY_LINE in out
    status, out, err = run("site", "city", *options, "--transparency", "as-is")
    assert status == 0, err
    assert "imported again" in out
    assert OPACITY_LINE not in out
    assert "The file has fully transparent surfaces, which are not drawn. Example: town: 64; --transparency inverted draws them\n" in out
