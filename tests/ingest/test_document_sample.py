"""Samples of documents: rings by the name of their CRS, from a bounded number of bytes."""

import gzip
import time
from pathlib import Path

import numpy as np

from map3d.geometry.crs import parse_crs
from map3d.ingest.axis_order import facing_axes, labelled_axes, named_axes, right_angled_axes
from map3d.ingest.document_sample import HEAD_BYTES, WINDOW_BYTES, WINDOWS, read_sample
from tests.odd_cities.towns import MUNICH, at, write_citygml

UTM = at(*MUNICH, "EPSG:25832")
RING = "<gml:LinearRing><gml:posList>{0}</gml:posList></gml:LinearRing>"
SQUARE = "0 0 0 8 0 0 8 8 0 0 8 0 0 0 0"


def write(path: Path, text: str) -> Path:
    path.write_text(f'<core:CityModel xmlns:gml="g" xmlns:core="c">{text}</core:CityModel>')
    return path


def test_rings_have_the_name_that_counts_for_them(tmp_path: Path) -> None:
    envelope = '<gml:boundedBy><gml:Envelope srsName="A" srsDimension="3" axisLabels="N E h" uomLabels="ft ft m"/></gml:boundedBy>'
    own = f'<core:cityObjectMember><gml:Solid srsName="B">{RING.format(SQUARE)}</gml:Solid></core:cityObjectMember>'
    other = f"<core:cityObjectMember>{RING.format(SQUARE)}</core:cityObjectMember>"
    sample = read_sample(write(tmp_path / "a.gml", envelope + own + other))
    assert [(ring.name, ring.member) for ring in sample.rings] == [("B", 0), ("A", 1)]
    assert (sample.names, sample.axis_labels, sample.units, sample.whole) == (["A", "B"], {"A": "N E h"}, {"A": "ft ft m"}, True)
    without = read_sample(write(tmp_path / "b.gml", own + other))
    assert [ring.name for ring in without.rings] == ["B", "B"], "what the first object names, where the document names nothing"


def test_positions_are_read_in_every_form(tmp_path: Path) -> None:
    forms = (
        RING.format(SQUARE),
        "<gml:LinearRing>" + "".join(f"<gml:pos>{p}</gml:pos>" for p in ("0 0 0", "8 0 0", "8 8 0", "0 8 0", "0 0 0")) + "</gml:LinearRing>",
        "<gml:LinearRing><gml:coordinates>0,0,0 8,0,0 8,8,0 0,8,0 0,0,0</gml:coordinates></gml:LinearRing>",
        '<gml:LinearRing><gml:posList srsDimension="2">0 0 8 0 8 8 0 8 0 0</gml:posList></gml:LinearRing>',
    )
    sample = read_sample(write(tmp_path / "a.gml", "".join(forms) + RING.format("1 2 x 4") + RING.format("1 2 3 4")))
    assert len(sample.rings) == len(forms)
    assert all(np.array_equal(ring.points, sample.rings[0].points) for ring in sample.rings)
    wide = tmp_path / "wide.gml"
    wide.write_bytes((tmp_path / "a.gml").read_text().encode("utf-16"))
    assert len(read_sample(wide).rings) == len(forms)


def test_few_bytes_of_a_large_document_are_read_from_all_over_it(tmp_path: Path) -> None:
    path = write_citygml(tmp_path / "town.gml", "EPSG:25832", UTM, side=40)
    assert path.stat().st_size > HEAD_BYTES + 2 * WINDOWS * WINDOW_BYTES
    sample, head = read_sample(path), read_sample(path, head_only=True)
    assert not sample.whole
    assert 0 < len(head.rings) < len(sample.rings) < 40 * 40 * 6
    points = np.concatenate([ring.points for ring in sample.rings])
    assert {ring.name for ring in sample.rings} == {"EPSG:25832"}
    assert np.ptp(points[:, 1]) > 1200.0, "rows of houses from the first to the last"
    assert facing_axes(sample.rings, parse_crs("EPSG:25832")) == "east-north"
    packed = tmp_path / "town.gml.gz"
    packed.write_bytes(gzip.compress(path.read_bytes(), 1))
    assert len(read_sample(packed).rings) == len(head.rings)


def test_what_is_no_document_has_an_empty_sample(tmp_path: Path) -> None:
    (tmp_path / "a.gml").write_bytes(b"\x1f\x8b broken")
    (tmp_path / "b.gml").write_bytes(bytes(range(256)) * 64)
    assert [read_sample(tmp_path / name).rings for name in ("a.gml", "b.gml", "none.gml")] == [[], [], []]


def test_hostile_texts_cost_no_more_than_their_length(tmp_path: Path) -> None:
    size = HEAD_BYTES
    texts = (
        "<" * size,
        "<" + "a" * size,
        "<a:" * (size // 3),
        "<a " + "srsName" * (size // 7),
        "<LinearRing>" * (size // 12),
        "<LinearRing>" + "<a>" * (size // 3),
    )
    started = time.process_time()
    for text in texts:
        assert read_sample(write(tmp_path / "a.gml", text)).rings == []
    assert time.process_time() - started < 5.0


def test_words_and_names_tell_the_order() -> None:
    assert [labelled_axes(text) for text in ("N E h", "Lat Long h", "northing,easting", "E N", "Long Lat h", "x y z", "", "h E N")] == [
        *["north-east"] * 3,
        *["east-north"] * 2,
        *["auto"] * 3,
    ]
    poland, utm = parse_crs("EPSG:2180"), parse_crs("EPSG:25832")
    assert named_axes("urn:ogc:def:crs:EPSG::2180", poland) == "north-east"
    assert named_axes("http://www.opengis.net/def/crs/EPSG/0/25832", utm) == "east-north"
    assert named_axes("EPSG:2180", poland) == "auto"
    assert named_axes(poland.to_wkt(), poland) == "north-east"
    assert named_axes(poland.to_wkt("WKT1_GDAL"), poland) == "east-north"


def test_mirrored_surfaces_face_the_other_way(tmp_path: Path) -> None:
    crs = parse_crs("EPSG:2180")
    for order, found in (((0, 1, 2), "east-north"), ((1, 0, 2), "north-east")):
        sample = read_sample(write_citygml(tmp_path / "town.gml", "EPSG:2180", at(21.0, 52.0, "EPSG:2180", order)))
        assert facing_axes(sample.rings, crs) == found
        two = [ring for ring in sample.rings if ring.member < 2]
        assert facing_axes(two, crs) == "auto", "too few"
        roofs = [ring for ring in sample.rings if abs(np.ptp(ring.points[:, 2])) < 0.01 and ring.points[0, 2] > 501.0]
        assert facing_axes(roofs, crs) == "auto", "open, and no one says that they are roofs"


def test_right_angles_tell_the_order_of_degrees() -> None:
    corners = np.array([(x, y, 0.0) for k in range(10) for x, y in ((0, 0), (8, 3), (5, 11), (-3, 8))], dtype=np.float64)
    lon_lat = at(19.0, 58.0, "EPSG:4326")(corners)
    assert right_angled_axes(lon_lat) == "east-north"
    assert right_angled_axes(lon_lat[:, [1, 0, 2]]) == "north-east"
    assert right_angled_axes(lon_lat[:8]) == "auto"
