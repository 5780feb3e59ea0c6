"""Cities whose coordinates are in another axis order or unit than their label says."""

from pathlib import Path

import numpy as np
import pytest

from map3d.catalogue import SceneRecord, Workspace
from map3d.cli.import_reports import place_line
from map3d.errors import CrsError
from map3d.ingest.content import content_centre
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import Imported, import_file
from map3d.ingest.sources import find_sources
from tests.cli.towns import Run
from tests.findings import warned
from tests.odd_cities.strays import polygon_at_0_0_0
from tests.odd_cities.towns import MUNICH, at, world_boxes, write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

SWAPPED = (1, 0, 2)
DEGREES = at(*MUNICH, "EPSG:4326")
UTM = at(*MUNICH, "EPSG:32632")


def add(tmp_path: Path, path: Path, scene: str = "town", **options: object) -> tuple[Workspace, Imported]:
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    if scene not in [record.name for record in catalogue.scenes()]:
        catalogue.create_scene(SceneRecord(scene))
    try:
        return workspace, import_file(workspace, catalogue, scene, find_sources([path])[0], ImportOptions(**options))  # type: ignore[arg-type]
    finally:
        catalogue.close()


def check_is_in_munich(workspace: Workspace, tmp_path: Path, scene: str = "town") -> None:
    """Compares the objects with those of the town in metres."""
    add(tmp_path, write_citygml(tmp_path / "right" / "right.gml", "EPSG:32632", UTM), "right")
    found, expected = world_boxes(workspace, scene), world_boxes(workspace, "right")
    assert sorted(found) == sorted(expected)
    assert len(expected) == 16
    for name, box in expected.items():
        assert np.allclose(found[name], box, atol=0.01), name


@pytest.mark.parametrize("label", ["EPSG:4326", "EPSG:4979", "urn:ogc:def:crs:EPSG::4326", "http://www.opengis.net/def/crs/EPSG/0/4979"])
def test_longitude_first_under_a_label_with_latitude_first_is_read_right_and_said(tmp_path: Path, label: str) -> None:
    workspace, done = add(tmp_path, write_citygml(tmp_path / "town.gml", label, DEGREES))
    (warning,) = warned(done.report)
    assert warning["code"] == "axes-read-as-longitude-latitude"
    assert "is near Munich, Germany (48.137° N, 11.57" in warning["example"]
    assert "from Bosaso, Somalia: give --crs urn:ogc:def:crs:EPSG::4" in warning["example"]
    assert done.report["placing"]["place"].startswith("near Munich, Germany")
    check_is_in_munich(workspace, tmp_path)


@pytest.mark.parametrize("label", ["EPSG:4326", "EPSG:4979", "urn:ogc:def:crs:EPSG::4979"])
def test_latitude_first_stays_and_nothing_is_warned_about(tmp_path: Path, label: str) -> None:
    workspace, done = add(tmp_path, write_citygml(tmp_path / "town.gml", label, at(*MUNICH, "EPSG:4326", SWAPPED)))
    assert warned(done.report) == []
    assert done.report["placing"]["place"].startswith("near Munich, Germany")
    check_is_in_munich(workspace, tmp_path)


@pytest.mark.parametrize("turn_deg", [0.0, 20.0])
def test_a_town_in_somalia_stays_there(tmp_path: Path, turn_deg: float) -> None:
    """The mirrored place of Bosaso is near Nuremberg."""
    path = write_citygml(tmp_path / "town.gml", "EPSG:4326", at(49.18, 11.28, "EPSG:4326", SWAPPED), turn_deg=turn_deg)
    _, done = add(tmp_path, path)
    assert warned(done.report) == []
    assert done.report["placing"]["place"].startswith("near Bosaso, Somalia")


def test_right_angles_decide_where_no_town_is_near(tmp_path: Path) -> None:
    """Rectangles stay rectangles only in the right order: a village in the Sahara, whose mirrored place is in the Baltic Sea."""
    for name, order, read_as in (("a", (0, 1, 2), "longitude-latitude"), ("b", SWAPPED, None)):
        _, done = add(tmp_path, write_citygml(tmp_path / f"{name}.gml", "EPSG:4326", at(19.0, 58.0, "EPSG:4326", order)), name)
        assert [warning["code"].rpartition("-as-")[2] for warning in warned(done.report)] == ([read_as] if read_as else []), name
        assert done.report["placing"]["place"].startswith("57.7 km north-east of Visby, Sweden (58° N, 19° E)"), name


def test_latitude_first_under_crs84_is_read_right(tmp_path: Path) -> None:
    workspace, done = add(tmp_path, write_citygml(tmp_path / "town.gml", "urn:ogc:def:crs:OGC:1.3:CRS84", at(*MUNICH, "EPSG:4326", SWAPPED)))
    assert warned(done.report)[0]["code"] == "axes-read-as-latitude-longitude"
    assert "give --crs OGC:CRS84 if that is right" in warned(done.report)[0]["example"]
    check_is_in_munich(workspace, tmp_path)


def test_northing_before_easting_is_read_right(tmp_path: Path) -> None:
    """The axis order of the authority, in which few write EPSG:31468."""
    workspace, done = add(tmp_path, write_citygml(tmp_path / "town.gml", "EPSG:32632", at(*MUNICH, "EPSG:32632", SWAPPED)))
    assert [warning["code"] for warning in warned(done.report)] == ["axes-read-as-northing-easting"]
    check_is_in_munich(workspace, tmp_path)


def test_an_option_that_states_the_axis_order_is_taken_at_its_word(tmp_path: Path) -> None:
    path = write_citygml(tmp_path / "town.gml", "EPSG:4326", DEGREES)
    workspace, done = add(tmp_path, path, crs="OGC:CRS84")
    assert warned(done.report) == []
    check_is_in_munich(workspace, tmp_path)
    _, done = add(tmp_path, path, "africa", crs="urn:ogc:def:crs:EPSG::4326")
    assert done.report["placing"]["place"] == "at 11.575° N, 48.137° E, 118 km from Bosaso, Somalia"
    assert warned(done.report) == []


def test_strict_imports_stop_at_swapped_axes(tmp_path: Path) -> None:
    with pytest.raises(CrsError, match="axes of the file are swapped"):
        add(tmp_path, write_citygml(tmp_path / "town.gml", "EPSG:4326", DEGREES), strict=True)


@pytest.mark.parametrize(("order", "option"), [((0, 1, 2), "OGC:CRS84"), (SWAPPED, "EPSG:4326")])
def test_degrees_labelled_as_gauss_kruger_are_refused_with_the_option_that_helps(tmp_path: Path, order: tuple[int, ...], option: str) -> None:
    path = write_citygml(tmp_path / "town.gml", "EPSG:31468", at(*MUNICH, "EPSG:4326", order))
    with pytest.raises(CrsError) as refused:
        add(tmp_path, path)
    text = str(refused.value)
    assert text.startswith(f"{path}: the label EPSG:31468 (DHDN / 3-degree Gauss-Kruger zone 4) is in metres, but the coordinates, e.g. ")
    assert "are degrees near Munich, Germany (48.137° N, 11.57" in text
    assert f"; give --crs {option} to read them as degrees, or --crs local for plain metres" in text
    workspace, _ = add(tmp_path, path, crs=option)
    check_is_in_munich(workspace, tmp_path)


def test_metres_labelled_as_degrees_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        CrsError, match=r"is in degrees, but the coordinates, e\.g\. 6\d+\.\d+ 5\d+\.\d+, are no degrees; name the right CRS with --crs"
    ):
        add(tmp_path, write_citygml(tmp_path / "town.gml", "EPSG:4326", UTM))
    with pytest.raises(CrsError, match=r"extend over [0-9]+°; name the right CRS with --crs"):
        add(tmp_path, write_citygml(tmp_path / "local.gml", "EPSG:4326", lambda corners: corners))


def test_points_outside_the_area_of_use_are_counted_and_located(tmp_path: Path) -> None:
    """A town near Berlin in UTM zone 33, labelled as Dutch; and metres from a local origin labelled as UTM."""
    path = write_citygml(tmp_path / "town.gml", "EPSG:28992", at(13.4, 52.5, "EPSG:25833"), side=2)
    _, done = add(tmp_path, path)
    (warning,) = warned(done.report)
    assert (warning["code"], warning["values"]["name"], warning["count"]) == ("points-outside-area-of-use", "Amersfoort / RD New", 96)
    assert "name the right CRS with --crs if this is wrong" in warning["example"]
    _, done = add(tmp_path, write_citygml(tmp_path / "local.gml", "EPSG:25832", lambda corners: corners, side=2), "local")
    (warning,) = warned(done.report)
    assert (warning["code"], warning["values"]["name"]) == ("points-outside-area-of-use", "ETRS89 / UTM zone 32N")
    assert warning["example"].endswith("from São Tomé, Sao Tome and Principe; give --crs local for plain metres")


def test_a_few_stray_points_do_not_cast_doubt_on_the_label(tmp_path: Path) -> None:
    _, done = add(tmp_path, polygon_at_0_0_0(tmp_path))
    (warning,) = warned(done.report)
    assert (warning["values"]["name"], warning["count"]) == ("ETRS89 / UTM zone 32N", 3)
    assert warning["example"].endswith("250 km from São Tomé, Sao Tome and Principe")


def test_a_town_at_the_edge_of_its_zone_is_no_oddity(tmp_path: Path) -> None:
    """Passau, east of zone 32, in which all of Bavaria is published."""
    _, done = add(tmp_path, write_citygml(tmp_path / "town.gml", "EPSG:25832", at(13.43, 48.57, "EPSG:25832")))
    assert warned(done.report) == []


def test_site_says_where_the_city_is_and_what_was_odd(tmp_path: Path, run: Run) -> None:
    write_citygml(tmp_path / "city" / "town.gml", "EPSG:4326", DEGREES)
    status, out, err = run("site", "city", "-o", "site", "--res", "2", "--view", "0-90", "--workers", "1")
    assert status == 0, err
    assert "place: near Munich, Germany (48.137° N, 11.575° E), WGS 84 / UTM zone 32N\n" in out
    assert "so it is read as longitude, latitude. Example: town: 11.57" in out
    report = (tmp_path / "site" / "report.html").read_text()
    assert "near Munich, Germany" in report
    assert "so it is read as longitude, latitude." in report
    assert str(tmp_path) not in report
    assert run("publish", "city", "-o", "again")[0] == 0
    assert (tmp_path / "again" / "report.html").read_text() == report
    assert run("verify", "--published", "again")[0] == 0
    status, out, err = run("add-files", "city", "city/town.gml")
    assert status == 0, err
    assert "place: near Munich, Germany" in out
    assert "The axes of the file are swapped, so it is read as longitude, latitude. Example: 11.57" in out


def test_site_refuses_degrees_labelled_as_metres_in_one_line(tmp_path: Path, run: Run) -> None:
    write_citygml(tmp_path / "city" / "town.gml", "EPSG:31468", DEGREES)
    status, _, err = run("site", "city", "-o", "site", "--res", "2", "--view", "0-90", "--workers", "1")
    assert status != 0
    assert err.strip().count("\n") == 0
    assert "give --crs OGC:CRS84 to read them as degrees" in err


def test_the_place_is_that_of_the_content(tmp_path: Path) -> None:
    """The origin of a scene is rounded to 100 m, and stays where the first file was."""
    add(tmp_path, write_citygml(tmp_path / "a.gml", "EPSG:25832", at(*MUNICH, "EPSG:25832"), side=1, prefix="a-"))
    workspace, _ = add(tmp_path, write_citygml(tmp_path / "b.gml", "EPSG:25832", at(MUNICH[0] + 0.009, MUNICH[1], "EPSG:25832"), prefix="b-"))
    low, high = zip(*world_boxes(workspace, "town").values(), strict=True)
    catalogue = workspace.open_catalogue()
    centre, origin = content_centre(workspace, catalogue, "town"), catalogue.scene("town").origin
    line = place_line(workspace, catalogue, "town")
    catalogue.close()
    assert np.allclose(centre, (np.min(low, axis=0) + np.max(high, axis=0)) / 2, atol=0.01)
    assert centre is not None
    assert origin is not None
    assert centre[0] > origin[0] + 200
    assert line == "place: near Munich, Germany (48.137° N, 11.58° E), ETRS89 / UTM zone 32N"
