"""What is decided about documents together, before the first of them is imported."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import SceneRecord
from map3d.coherence.plan import ImportPlan, plan_import
from map3d.geometry.crs import parse_crs
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.scene_crs import to_scene_crs
from map3d.ingest.sources import find_sources
from tests.odd_cities.towns import MUNICH, LonLat, at, write_citygml

FIELDS, LABEL = (18.5, 52.7), "urn:ogc:def:crs:EPSG::2180"
EAST_FIRST, NORTH_FIRST = (0, 1, 2), (1, 0, 2)


def write(folder: Path, name: str, place: LonLat, order: tuple[int, int, int], *, side: int = 4) -> None:
    write_citygml(folder / f"{name}.gml", LABEL, at(*place, "EPSG:2180", order), side=side, turn_deg=0.0)


def plan(folder: Path, scene: SceneRecord | None = None, **options: str) -> ImportPlan:
    return plan_import(find_sources([folder]), ImportOptions(**options), scene or SceneRecord("town"))  # type: ignore[arg-type]


def test_a_house_follows_the_files_around_it(tmp_path: Path) -> None:
    write(tmp_path, "town", FIELDS, EAST_FIRST)
    write(tmp_path, "house", (18.5, 52.71), EAST_FIRST, side=1)
    found = plan(tmp_path)
    assert found.axes == {"house": "east-north"}
    house, _ = found.sources
    assert found.options(house, ImportOptions()).followed_axes == "east-north"
    assert found.options(found.sources[1], ImportOptions()) == ImportOptions()
    assert plan(tmp_path, axes="north-east").axes == {}


def test_a_house_far_from_the_other_files_follows_none(tmp_path: Path) -> None:
    write(tmp_path, "house", FIELDS, EAST_FIRST, side=1)
    write_citygml(tmp_path / "munich.gml", "EPSG:25832", at(*MUNICH, "EPSG:25832"))
    assert plan(tmp_path).axes == {}


def test_a_house_follows_the_content_of_the_scene(tmp_path: Path) -> None:
    write(tmp_path, "house", FIELDS, EAST_FIRST, side=1)
    x, y, _ = at(*FIELDS, "EPSG:2180")(np.zeros((1, 3)))[0]
    scene = SceneRecord("town", crs=to_scene_crs(parse_crs("EPSG:2180")), origin=(x, y, 0.0))
    assert plan(tmp_path, scene).axes == {"house": "east-north"}


def test_files_of_the_largest_place_come_first(tmp_path: Path) -> None:
    write(tmp_path, "a", (15.5, 51.3), NORTH_FIRST, side=3)
    write(tmp_path, "b", FIELDS, NORTH_FIRST)
    write(tmp_path, "c", FIELDS, NORTH_FIRST, side=5)
    (tmp_path / "d.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert [source.name for source in plan(tmp_path).sources] == ["b", "c", "a", "d"]
    (tmp_path / "a.gml").unlink()
    write(tmp_path, "e", FIELDS, NORTH_FIRST, side=6)
    assert [source.name for source in plan(tmp_path).sources] == ["b", "c", "e", "d"], "in one place, the given order"
