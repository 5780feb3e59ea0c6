"""Object ids that are unique over all scenes, and the sequence of the contents."""

from pathlib import Path

import numpy as np

from map3d.portrayal.service_state import ServiceState, to_service_id, to_service_ids


def test_ids_of_all_scenes_differ_and_stay(tmp_path: Path) -> None:
    state = ServiceState(tmp_path / "service.sqlite")
    a, b = state.pages("a", 70_000), state.pages("b", 10)
    assert (a, b) == ([0, 1], [2])
    assert state.pages("a", 200_000) == [0, 1, 3, 4]
    state.close()
    again = ServiceState(tmp_path / "service.sqlite")
    assert (again.pages("b", 10), again.pages("a", 70_000)[:2]) == (b, a)
    for scene, number in (("a", 1), ("a", 65_535), ("a", 65_536), ("a", 199_999), ("b", 7)):
        pages = again.pages(scene, 200_000 if scene == "a" else 10)
        assert again.scene_of(to_service_id(number, pages)) == (scene, number)
    assert again.scene_of(0) is None
    assert again.scene_of(0xFFFFFFFF) is None


def test_arrays_of_ids_are_those_of_single_ids() -> None:
    pages, ids = [7, 2, 9], np.array([[0, 1, 65_535], [65_536, 131_072, 140_000]], np.uint32)
    expected = [[0 if number == 0 else to_service_id(number, pages) for number in row] for row in ids.tolist()]
    assert to_service_ids(ids, pages).tolist() == expected
    assert to_service_ids(ids, [0, 1, 2]) is ids


def test_sequence_grows_with_each_change(tmp_path: Path) -> None:
    state = ServiceState(tmp_path / "service.sqlite")
    assert [state.sequence(version) for version in ("a", "a", "b", "b", "a")] == [1, 1, 2, 2, 3]
