"""Asset folders: boxes, digests, putting in place."""

from pathlib import Path

import numpy as np
import pytest

from map3d import _core
from map3d.ingest.asset import asset_digest, new_objects, put_in_place, read_objects, world_boxes, write_ids
from map3d.ingest.importing import choose_origin
from map3d.scenes.scene_files import check_file
from tests.ingest.meshes import write_asset

POINTS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (5, 5, 5), (6, 5, 5), (5, 7, 9)]
TRIANGLES = [(0, 1, 2), (3, 4, 5)]


def test_boxes_are_those_of_each_object(tmp_path: Path) -> None:
    folder = write_asset(tmp_path / "a", POINTS, TRIANGLES, [2, 0])
    assert world_boxes(folder, 3) == [((5.0, 5.0, 5.0), (6.0, 7.0, 9.0)), None, ((0.0, 0.0, 0.0), (1.0, 1.0, 0.0))]


def test_boxes_of_placements_are_moved_prototypes(tmp_path: Path) -> None:
    """A prototype turned by 90° about z, twice as large, moved by (100, 200, 10)."""
    placed = [{"prototype": 1, "object": 1, "transform": [0, -2, 0, 100, 2, 0, 0, 200, 0, 0, 2, 10]}]
    folder = write_asset(tmp_path / "a", POINTS, TRIANGLES, [0, 1], prototypes=[0, 1], instances=placed)
    assert world_boxes(folder, 2) == [((0.0, 0.0, 0.0), (1.0, 1.0, 0.0)), ((86.0, 210.0, 20.0), (90.0, 212.0, 28.0))]


def test_local_boxes_start_at_the_origin(tmp_path: Path) -> None:
    folder = write_asset(tmp_path / "a", POINTS, TRIANGLES, [0, 1])
    local = new_objects(read_objects(folder), world_boxes(folder, 2), (1.0, 2.0, 3.0))
    assert [item.box for item in local] == [((-1.0, -2.0, -3.0), (0.0, -1.0, -3.0)), ((4.0, 3.0, 2.0), (5.0, 5.0, 6.0))]


def test_an_empty_mesh_has_no_boxes(tmp_path: Path) -> None:
    folder = write_asset(tmp_path / "a", np.zeros((0, 3)), np.zeros((0, 3)), [], names=["lonely"])
    assert world_boxes(folder, 1) == [None]


@pytest.mark.parametrize(
    "change", [lambda data: data[:50], lambda data: data[:-70], lambda data: b"NOPE" + data[4:], lambda data: data[:4] + b"\2" + data[5:]]
)
def test_a_mesh_that_is_not_one_is_refused(tmp_path: Path, change: "object") -> None:
    assert callable(change)
    folder = write_asset(tmp_path / "a", POINTS, TRIANGLES, [0, 1])
    path = folder / "mesh.m3a"
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(_core.FormatError, match=r"mesh\.m3a"):
        world_boxes(folder, 2)
    assert check_file(path) is not None


def test_a_flipped_bit_shows_in_the_checksum(tmp_path: Path) -> None:
    path = write_asset(tmp_path / "a", POINTS, TRIANGLES, [0, 1]) / "mesh.m3a"
    assert check_file(path) is None
    data = bytearray(path.read_bytes())
    data[100] ^= 4
    path.write_bytes(bytes(data))
    assert "checksum" in (check_file(path) or "")


def test_the_digest_tells_content(tmp_path: Path) -> None:
    digests = []
    for name, moved in (("a", 0.0), ("b", 0.0), ("c", 1e-9)):
        folder = write_asset(tmp_path / name, np.array(POINTS) + moved, TRIANGLES, [0, 1])
        write_ids(folder, np.array([1, 2], np.uint32))
        digests.append(asset_digest(folder))
    assert digests[0] == digests[1] != digests[2]
    write_ids(tmp_path / "a", np.array([1, 3], np.uint32))
    assert asset_digest(tmp_path / "a") != digests[0]


def test_a_new_folder_takes_the_place_of_the_old_one(tmp_path: Path) -> None:
    final = tmp_path / "final"
    for text in ("old", "new"):
        draft = tmp_path / ".draft"
        draft.mkdir()
        (draft / "file").write_text(text)
        put_in_place(draft, final)
        assert (final / "file").read_text() == text
        assert sorted(path.name for path in tmp_path.iterdir()) == ["final"]


@pytest.mark.parametrize(
    ("box", "origin"),
    [
        (((691_020.0, 5_336_010.0, 512.0), (691_290.0, 5_336_130.0, 540.0)), (691_200.0, 5_336_100.0, 500.0)),
        (((-1.0, -2.0, 0.0), (90.0, 20.0, 15.0)), (0.0, 0.0, 0.0)),
        (((-180.0, -20.0, -80.0), (-170.0, 20.0, 15.0)), (-200.0, 0.0, -100.0)),
    ],
)
def test_origins_are_multiples_of_100_m_near_the_content(box: object, origin: tuple[float, float, float]) -> None:
    assert choose_origin([None, box]) == origin  # type: ignore[list-item]
    assert all(value * 2**12 == int(value * 2**12) for value in origin)


def test_no_content_has_origin_zero() -> None:
    assert choose_origin([]) == (0.0, 0.0, 0.0)
