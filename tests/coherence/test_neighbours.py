"""Heights of files beside each other are compared where no terrain decides; a choice of heights counts for the files that it is given for."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.coherence.height_rules import HeightRules, with_choice, with_choice_of_files
from map3d.coherence.neighbours import FileBases, compare_files
from tests.coherence.documents import STEP_M, House, Scene, new_scene, slope, town, write_dem, write_houses, write_photo

GEOID_M = 46.5


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    with new_scene(tmp_path) as found:
        yield found


def beside(prefix: str, *, tiles: float = 1.0, above: float = 0.0, base: float | None = None, factor: float = 1.0) -> list[House]:
    """Returns a town `tiles` towns north of the first one."""
    return [replace(house, y=house.y + 4 * STEP_M * tiles) for house in town(prefix, above=above, base=base, factor=factor)]


def of_files(*files: list[House], right: int | None = None) -> list[tuple[int, int, str, int]]:
    """Returns (file, beside, kind, metres) of what `compare_files` finds."""
    points = [np.array([(h.x + 5, h.y + 4, h.z) for h in houses]).reshape(-1, 3) for houses in files]
    bases = [FileBases(each, np.full(len(each), 12.8), number == right, False) for number, each in enumerate(points)]
    return [(found.file, found.beside, found.kind, round(found.metres)) for found in compare_files(bases, lambda: GEOID_M)]


def test_tiles_on_one_slope_agree() -> None:
    assert of_files(beside("a"), beside("b", tiles=1), beside("c", tiles=2)) == []
    assert of_files() == of_files([]) == of_files([], beside("a")) == []


def test_a_slope_of_one_in_three_explains_the_distance_of_neighbours() -> None:
    hill = [[replace(house, z=0.33 * house.y) for house in beside("a", tiles=tiles)] for tiles in (0, 1)]
    assert of_files(*hill) == []


@pytest.mark.parametrize("tiles", [1.0, 0.25, 0.03])
def test_the_file_that_differs_is_named_whether_beside_or_between(tiles: float) -> None:
    assert of_files(beside("a", tiles=0), beside("b", tiles=tiles, above=-500.0)) == [(1, 0, "heights-below-terrain", -500)]
    assert of_files(beside("b", tiles=tiles, base=0.0), beside("a", tiles=0)) == [(0, 1, "heights-at-zero", -509)], "the one at 0, not the second"
    assert of_files(beside("a", tiles=0, above=46.5), beside("b", tiles=tiles)) == [(0, 1, "heights-ellipsoidal", 46)], "the higher one"
    assert of_files(beside("a", tiles=0), beside("b", tiles=tiles, factor=1 / 0.3048))[0][:3] == (1, 0, "heights-in-feet")
    assert of_files(beside("a", tiles=0, factor=1 / 0.3048), beside("b", tiles=tiles))[0][:3] == (0, 1, "heights-in-feet")


def test_most_objects_are_right_and_so_is_who_fits_the_terrain() -> None:
    row = [beside("a", tiles=0), beside("b", tiles=1, above=500.0), beside("c", tiles=2)]
    assert of_files(*row) == [(1, 0, "heights-above-terrain", 500)], "c agrees with a, by way of b"
    assert of_files(*row, right=1) == [(0, 1, "heights-below-terrain", -500), (2, 1, "heights-below-terrain", -500)]
    assert of_files(row[0][-4:], row[1]) == [(0, 1, "heights-below-terrain", -500)]


def test_a_file_that_touches_wrong_ones_alone_is_named_for_its_own_fault() -> None:
    row = [beside("a", tiles=0), beside("b", tiles=1, factor=1 / 0.3048), beside("c", tiles=2, base=0.0), beside("e", tiles=-1)]
    assert [(file, kind) for file, _, kind, _ in of_files(*row)] == [(1, "heights-in-feet"), (2, "heights-at-zero")]
    row[2] = beside("c", tiles=2, factor=1 / 0.3048)
    assert [(file, kind) for file, _, kind, _ in of_files(*row)] == [(1, "heights-in-feet"), (2, "heights-in-feet")]


def test_single_objects_contradict_several_others_if_they_are_far_off() -> None:
    assert of_files(beside("a", tiles=0), beside("b", tiles=1, above=80.0)[:2]) == []
    assert of_files(beside("a", tiles=0), beside("b", tiles=1, above=500.0)[:2]) == [(1, 0, "heights-above-terrain", 498)]
    lone = [beside("a", tiles=0)[-1:], beside("b", tiles=1)[3:4]]
    assert of_files(*lone) == of_files(lone[0], [replace(house, z=house.z + 80.0) for house in lone[1]]) == []
    assert of_files(lone[0], [replace(house, z=house.z + 500.0) for house in lone[1]]) == [(1, 0, "heights-above-terrain", 500)]


@pytest.mark.parametrize(("above", "code"), [(-500.0, "heights-unlike-file"), (46.5, "heights-ellipsoidal-beside-file")])
def test_a_file_is_moved_by_the_option_that_is_said(tmp_path: Path, scene: Scene, above: float, code: str) -> None:
    one, other = write_houses(tmp_path / "a.gml", town("a")), write_houses(tmp_path / "b.gml", beside("b", above=above))
    scene.add(one, other, write_photo(tmp_path / "photo.tif"))
    found = scene.the(code)
    assert (found.count, found.reason.values["file"], found.reason.values["offset"]) == (16, "a.gml", f"{-above:+.1f}")
    scene.add(one, other, heights=str(-above))
    assert code not in scene.codes()
    boxes = scene.boxes()
    for house in (*town("a"), *beside("b")):
        assert boxes[house.name][0][2] == pytest.approx(house.z, abs=1e-3)
    photo = [box for name, box in boxes.items() if name.startswith("photo")]
    assert min(box[0][2] for box in photo) > 500.0, "the photo lies on the ground of the right file"
    assert max(box[1][2] for box in photo) < 520.0


def test_houses_at_0_beside_others_are_set_on_the_ground_between_those(tmp_path: Path, scene: Scene) -> None:
    files = [write_houses(tmp_path / "a.gml", town("a")), write_houses(tmp_path / "b.gml", beside("b", tiles=0.05, base=0.0))]
    scene.add(*files)
    assert scene.the("heights-at-zero-beside-file").count == 16
    scene.add(*files, heights="clamp")
    assert {"heights-at-zero-beside-file", "objects-off-ground"} & scene.codes() == set()
    boxes = scene.boxes()
    for house in beside("b", tiles=0.05):
        assert boxes[house.name][0][2] == pytest.approx(house.z, abs=3.0)


def test_houses_beside_the_terrain_are_compared_with_those_on_it(tmp_path: Path, scene: Scene) -> None:
    far = beside("b", tiles=2.0, above=-500.0)
    middle = beside("c", tiles=1)
    scene.add(
        write_dem(tmp_path / "dem.tif"),
        *(write_houses(tmp_path / f"{name}.gml", made) for name, made in (("a", town("a")), ("b", far), ("c", middle))),
    )
    assert scene.the("heights-unlike-file").reason.values["file"] == "c.gml"
    assert [name for name, said in scene.said().items() if any(found.reason.code == "heights-unlike-file" for found in said)] == ["b"]


def test_a_choice_of_heights_counts_for_the_files_that_it_is_given_for(tmp_path: Path, scene: Scene) -> None:
    one, other = write_houses(tmp_path / "a.gml", town("a")), write_houses(tmp_path / "b.gml", [replace(h, y=h.y + 2000.0) for h in town("b")])
    scene.add(one, other)
    scene.add(other, heights="46.5")
    boxes = scene.boxes()
    assert boxes["a0"][0][2] == pytest.approx(float(slope(np.array(691_001.0), np.array(0.0))), abs=1e-3)
    assert boxes["b0"][0][2] == pytest.approx(boxes["a0"][0][2] + 46.5, abs=1e-3)
    scene.add(other, unchanged=True)
    assert scene.boxes() == boxes, "a choice stays"
    scene.add(other, heights="auto")
    assert scene.boxes()["b0"][0][2] == pytest.approx(boxes["a0"][0][2], abs=1e-3)


def test_choices_of_files_replace_and_complete_each_other() -> None:
    options = with_choice({"style": []}, "clamp", [])
    options = with_choice_of_files(options, ["b", "a"], "3", [])
    options = with_choice_of_files(options, ["b"], None, ["road"])
    rules = HeightRules.of(options)
    assert [(rule.offset_m, rule.clamp, sorted(names)) for rule, names in rules.groups(["a", "b", "c"])] == [
        (3.0, (), ["a"]),
        (3.0, ("road",), ["b"]),
        (None, (), ["c"]),
    ]
    assert rules.others.heights == "clamp"
    assert with_choice_of_files(options, ["a", "b"], "clamp", ["none"]) == {"style": [], "heights": "clamp"}
