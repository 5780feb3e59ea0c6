"""Rasters without a CRS, and rasters with one in a scene in local metres."""

from pathlib import Path

import pytest

from map3d.errors import CrsError
from tests.findings import warned
from tests.ingest.terrain.rasters import from_bounds, hills, write
from tests.odd_cities.test_axis_order import add
from tests.odd_cities.towns import MUNICH, at, world_boxes, write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

UTM = at(*MUNICH, "EPSG:25832")


def test_a_raster_without_crs_alone_is_in_local_metres_and_says_so(tmp_path: Path) -> None:
    dem = write(tmp_path / "dem.tif", hills(4, 4), crs=None)
    _, done = add(tmp_path, dem)
    (warning,) = warned(done.report)
    assert warning["code"] == "raster-read-as-local"
    assert warning["example"] == "dem.tif; name its CRS with --crs, e.g. --crs EPSG:25832"
    _, done = add(tmp_path, dem, "stated", crs="local")
    assert warned(done.report) == []


def test_a_stated_crs_locates_a_raster_without_one(tmp_path: Path) -> None:
    _, done = add(tmp_path, write(tmp_path / "dem.tif", hills(4, 4), crs=None), crs="EPSG:25832")
    assert warned(done.report) == []
    assert done.report["placing"]["place"].startswith("near Munich, Germany")


def test_a_raster_without_crs_near_the_scene_takes_its_crs(tmp_path: Path) -> None:
    add(tmp_path, write_citygml(tmp_path / "town.gml", "EPSG:25832", UTM))
    workspace, done = add(tmp_path, write(tmp_path / "dem.tif", hills(4, 4), crs=None))
    assert [warning["code"] for warning in warned(done.report)] == ["raster-crs-assumed"]
    assert world_boxes(workspace, "town")["dem-0-0"][0][:2] == (691_000.0, 5_335_996.0)


@pytest.mark.parametrize(
    ("transform", "words"),
    [
        (
            from_bounds(4_468_000, 5_333_000, 4_468_100, 5_333_100, 4, 4),
            r"without a CRS of its own, with the scene's .*the raster lies 3,7\d\d km from",
        ),
        (from_bounds(11.5, 48.1, 11.52, 48.12, 4, 4), r"look like degrees near Munich, Germany .*; give --crs OGC:CRS84"),
    ],
)
def test_a_raster_without_crs_far_from_the_scene_is_refused(tmp_path: Path, transform: object, words: str) -> None:
    add(tmp_path, write_citygml(tmp_path / "town.gml", "EPSG:25832", UTM))
    with pytest.raises(CrsError, match=words):
        add(tmp_path, write(tmp_path / "dem.tif", hills(4, 4), crs=None, transform=transform))


def test_a_raster_with_crs_far_from_a_local_scene_is_refused(tmp_path: Path) -> None:
    add(tmp_path, write_citygml(tmp_path / "town.gml", None, lambda corners: corners), crs="local")
    with pytest.raises(
        CrsError, match=r"the raster lies 5,3\d\d km from the scene's content; name the CRS of the raster or of the other files with --crs"
    ):
        add(tmp_path, write(tmp_path / "dem.tif", hills(4, 4)))
    _, done = add(tmp_path, tmp_path / "dem.tif", crs="local")
    (warning,) = warned(done.report)
    assert warning["code"] == "raster-far-from-scene"


def test_a_raster_with_crs_whose_numbers_fit_a_local_scene_is_kept(tmp_path: Path) -> None:
    """An OBJ with the numbers of a UTM zone, which it cannot name, beside a GeoTIFF that names it."""
    (tmp_path / "town.obj").write_text("v 691000 5335990 510\nv 691008 5335990 510\nv 691008 5335998 510\nf 1 2 3\n")
    add(tmp_path, tmp_path / "town.obj")
    _, done = add(tmp_path, write(tmp_path / "dem.tif", hills(4, 4)))
    (warning,) = warned(done.report)
    assert warning["code"] == "raster-crs-not-used"
    assert warning["example"].endswith("e.g. --crs EPSG:25832")


def test_a_raster_outside_the_area_of_its_crs_is_warned_about(tmp_path: Path) -> None:
    _, done = add(tmp_path, write(tmp_path / "dem.tif", hills(4, 4), crs="EPSG:28992"))
    (warning,) = warned(done.report)
    assert (warning["code"], warning["values"], warning["count"]) == ("raster-outside-area-of-use", {"name": "Amersfoort / RD New"}, 4)
    assert warning["example"].startswith("dem.tif: 691000 5335996 is ")
