"""Objects that several files have are drawn once: the finer of two, else the first; equal names elsewhere are other objects."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.coherence.documents import STEP_M, House, Scene, new_scene, town, write_houses

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    with new_scene(tmp_path) as found:
        yield found


def moved(houses: list[House], x: float) -> list[House]:
    return [House(house.name, house.x + x, house.y, house.z, house.height) for house in houses]


def test_the_finer_level_of_detail_of_two_files_is_drawn(tmp_path: Path, scene: Scene) -> None:
    coarse = write_houses(tmp_path / "LoD1" / "690_5336.gml", town(side=5), lod=1)
    fine = write_houses(tmp_path / "LoD2" / "690_5336.gml", [house for house in town(side=5) if house.name != "b7"], lod=2)
    scene.add(tmp_path / "LoD1", tmp_path / "LoD2")
    found = scene.the("objects-finer-elsewhere")
    assert (found.count, found.reason.values["file"]) == (24, "LoD2/690_5336.gml")
    boxes = scene.boxes()
    assert len(boxes) == 25
    assert boxes["b3"][1][2] - boxes["b3"][0][2] == pytest.approx(9.0), "with its roof"
    assert boxes["b7"][1][2] - boxes["b7"][0][2] == pytest.approx(6.0), "what only the coarse file has stays"
    _, report = scene.build()
    assert report["adjusted_away"] == 24 * 12
    fine.unlink()
    assert coarse.exists()


def test_a_coarser_set_with_other_names_is_left_out(tmp_path: Path, scene: Scene) -> None:
    write_houses(tmp_path / "a" / "lod1.gml", town("coarse"), lod=1)
    write_houses(tmp_path / "a" / "lod2.gml", town("fine"), lod=2)
    scene.add(tmp_path / "a")
    assert scene.the("objects-finer-elsewhere").count == 16
    assert all(name.startswith("fine") for name in scene.boxes())


@pytest.mark.parametrize("prefix", ["b", "other"])
def test_equal_houses_under_any_name_are_drawn_once(tmp_path: Path, scene: Scene, prefix: str) -> None:
    write_houses(tmp_path / "a" / "a.gml", town())
    write_houses(tmp_path / "a" / "z.gml", town(prefix)[::-1])
    scene.add(tmp_path / "a")
    found = scene.the("file-is-copy")
    assert (found.count, found.reason.values["file"]) == (16, "a.gml")
    assert set(scene.boxes()) == {house.name for house in town()}
    _, report = scene.build()
    assert report["triangles_read"] == 2 * report["adjusted_away"]


def test_tiles_that_overlap_at_their_edges_have_each_house_once(tmp_path: Path, scene: Scene) -> None:
    houses = town(side=4)
    west, east = ([house for house in houses if house.x - houses[0].x in places] for places in ((0, STEP_M), (STEP_M, 2 * STEP_M, 3 * STEP_M)))
    write_houses(tmp_path / "a" / "east.gml", east)
    write_houses(tmp_path / "a" / "west.gml", west)
    scene.add(tmp_path / "a")
    assert scene.the("objects-elsewhere").count == 4
    assert len(scene.boxes()) == 16


def test_equal_names_in_other_places_are_other_objects(tmp_path: Path, scene: Scene) -> None:
    write_houses(tmp_path / "a" / "one.gml", town())
    write_houses(tmp_path / "a" / "two.gml", moved(town(), 500.0))
    scene.add(tmp_path / "a")
    assert not {"objects-elsewhere", "file-is-copy", "objects-finer-elsewhere"} & scene.codes()
    _, report = scene.build()
    assert "adjusted_away" not in report


def test_an_object_returns_when_the_file_that_had_it_too_leaves(tmp_path: Path, scene: Scene) -> None:
    from map3d.ingest.asset_removal import remove_assets

    write_houses(tmp_path / "a" / "a.gml", town())
    write_houses(tmp_path / "a" / "z.gml", town()[::-1])
    scene.add(tmp_path / "a")
    scene.build()
    remove_assets(scene.workspace, scene.catalogue, "town", ["a"])
    _, report = scene.build()
    assert report["triangles"] > 16 * 14
    assert "file-is-copy" not in scene.codes()
