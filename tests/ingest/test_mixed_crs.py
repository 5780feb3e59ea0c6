"""Files whose elements name different coordinate systems: each part is transformed from its own, or skipped and counted."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyproj import Transformer

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import SceneRecord, Workspace
from map3d.errors import CrsError, ImportFailed
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import Imported, import_file
from map3d.ingest.sources import find_sources
from map3d.registry import Registry
from tests.findings import skipped, warned

MODEL = """<core:CityModel xmlns:core="http://www.opengis.net/citygml/2.0" xmlns:bldg="http://www.opengis.net/citygml/building/2.0"
 xmlns:gml="http://www.opengis.net/gml" xmlns:veg="http://www.opengis.net/citygml/vegetation/2.0">{envelope}{members}</core:CityModel>"""
ENVELOPE = '<gml:boundedBy><gml:Envelope srsName="{srs}"><gml:lowerCorner>0 0 0</gml:lowerCorner></gml:Envelope></gml:boundedBy>'
BUILDING = """<core:cityObjectMember><bldg:Building gml:id="{name}"><bldg:lod2MultiSurface><gml:MultiSurface{srs}><gml:surfaceMember>
<gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>{ring}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon>
</gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface></bldg:Building></core:cityObjectMember>"""
TREE = """<core:cityObjectMember><veg:SolitaryVegetationObject gml:id="{name}"><veg:lod1ImplicitRepresentation><core:ImplicitGeometry>
<core:relativeGMLGeometry><gml:MultiSurface><gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing>
<gml:posList>0 0 0 2 0 0 2 0 3 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember></gml:MultiSurface>
</core:relativeGMLGeometry><core:referencePoint><gml:Point{srs}><gml:pos>{point}</gml:pos></gml:Point></core:referencePoint>
</core:ImplicitGeometry></veg:lod1ImplicitRepresentation></veg:SolitaryVegetationObject></core:cityObjectMember>"""

UTM, GAUSS_KRUEGER = "urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::7837", "EPSG:31468"
CORNERS = np.array([(691010, 5336010, 510), (691020, 5336010, 510), (691020, 5336020, 515), (691010, 5336020, 515), (691010, 5336010, 510)])


def ring(crs: str = "EPSG:25832", *, dx: float = 0.0, lat_first: bool = False) -> str:
    x, y = Transformer.from_crs("EPSG:25832", crs, always_xy=True).transform(CORNERS[:, 0] + dx, CORNERS[:, 1])
    return " ".join(f"{b:.9f} {a:.9f} {z}" if lat_first else f"{a:.9f} {b:.9f} {z}" for a, b, z in zip(x, y, CORNERS[:, 2], strict=True))


def building(name: str, ring: str, srs: str | None = None) -> str:
    return BUILDING.format(name=name, ring=ring, srs=f' srsName="{srs}"' if srs else "")


def model(*members: str, envelope: str = UTM) -> str:
    return MODEL.format(envelope=ENVELOPE.format(srs=envelope), members="".join(members))


def add(tmp_path: Path, text: str, options: ImportOptions | None = None) -> tuple[Imported, dict[str, Any]]:
    """Returns the import and the boxes of its objects."""
    tmp_path.mkdir(exist_ok=True)
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    (tmp_path / "a.gml").write_text(text)
    try:
        done = import_file(workspace, catalogue, "town", find_sources([tmp_path / "a.gml"])[0], options or ImportOptions())
        origin = catalogue.scene("town").origin
    finally:
        catalogue.close()
    with Registry(workspace.registry_path("town")) as registry:
        found = {record.name: np.array(record.box) + origin for record in registry.objects() if record.box is not None}
    return done, found


def warnings(done: Imported) -> list[str]:
    return [warning["code"] for warning in warned(done.report)]


def expected(dx: float = 0.0) -> np.ndarray[Any, Any]:
    low, high = CORNERS.min(axis=0).astype(float), CORNERS.max(axis=0).astype(float)
    return np.array([low, high]) + np.array([dx, 0.0, 0.0])


def test_geometry_in_another_crs_than_the_envelope_is_transformed(tmp_path: Path) -> None:
    text = model(building("here", ring()), building("there", ring(GAUSS_KRUEGER, dx=50.0), GAUSS_KRUEGER))
    done, boxes = add(tmp_path, text)
    assert np.array_equal(boxes["here"], expected())
    assert np.allclose(boxes["there"], expected(50.0), atol=5.0), "within the accuracy of the transformation between the datums"
    (said,) = warned(done.report)
    assert said["code"] == "parts-in-other-crs"
    assert (said["count"], said["example"].startswith("EPSG:31468: from DHDN / 3-degree Gauss-Kruger zone 4 to ETRS89 / UTM zone 32N")) == (2, True)
    assert (done.triangles, skipped(done.report), done.report["placing"]["from"]) == (4, {}, "ETRS89 / UTM zone 32N + DHHN2016 height")


def test_an_envelope_alone_in_its_crs_says_nothing(tmp_path: Path) -> None:
    done, boxes = add(tmp_path, model(building("b", ring(), "EPSG:25832"), envelope="EPSG:4326"))
    assert np.array_equal(boxes["b"], expected())
    assert (done.report["crs"], done.report["placing"]["from"], warned(done.report)) == ("EPSG:25832", "ETRS89 / UTM zone 32N", [])
    _, boxes = add(tmp_path / "other", model(building("b", ring(), "EPSG:25832"), envelope="#unknown"))
    assert np.array_equal(boxes["b"], expected()), "no part is in the unknown one"


@pytest.mark.parametrize(
    "srs",
    [
        "EPSG:25832",
        "http://www.opengis.net/def/crs/EPSG/0/25832",
        "urn:ogc:def:crs,crs:EPSG:6.12:25832,crs:EPSG:6.12:7837",
        "urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH",
        "EPSG:25832+7837",
    ],
)
def test_equivalent_names_and_the_horizontal_part_are_the_same_crs(tmp_path: Path, srs: str) -> None:
    done, boxes = add(tmp_path, model(building("a", ring()), building("b", ring(dx=20.0), srs)))
    assert np.array_equal(boxes["b"], expected(20.0))
    assert (warned(done.report), skipped(done.report)) == ([], {})


def test_each_name_has_its_order_of_axes(tmp_path: Path) -> None:
    text = model(
        building("b", ring("EPSG:4326", lat_first=True)),
        building("c", ring("EPSG:4326", dx=50.0), "urn:ogc:def:crs:OGC:1.3:CRS84"),
        envelope="EPSG:4326",
    )
    done, boxes = add(tmp_path, text)
    assert np.allclose(boxes["c"][0] - boxes["b"][0], [50.0, 0.0, 0.0], atol=0.01)
    assert skipped(done.report) == {}


def test_trees_lie_where_they_stand_not_where_their_prototypes_are_drawn(tmp_path: Path) -> None:
    done, boxes = add(tmp_path, model(*(TREE.format(name=f"t{n}", srs="", point=f"{691030 + n} 5336010 510") for n in range(3))))
    assert "Munich" in done.report["placing"]["place"]
    assert np.allclose(boxes["t2"][0], [691032.0, 5336010.0, 510.0])


def test_reference_points_are_in_their_own_crs(tmp_path: Path) -> None:
    x, y = Transformer.from_crs("EPSG:25832", GAUSS_KRUEGER, always_xy=True).transform(691050, 5336010)
    trees = (
        TREE.format(name="near", srs=' srsName="EPSG:25832"', point="691030 5336010 510"),
        TREE.format(name="far", srs=f' srsName="{GAUSS_KRUEGER}"', point=f"{x:.6f} {y:.6f} 510"),
        TREE.format(name="lost", srs=' srsName="EPSG:99999"', point="1 2 3"),
    )
    done, boxes = add(tmp_path, model(building("b", ring()), *trees))
    assert np.allclose(boxes["near"][0], [691030.0, 5336010.0, 510.0])
    assert np.allclose(boxes["far"][0], [691050.0, 5336010.0, 510.0], atol=5.0)
    assert "lost" not in boxes
    assert [item["values"] for item in done.report["findings"] if item["code"] == "part-crs-unusable"] == [{"name": "EPSG:99999"}]
    assert "parts-in-other-crs" in warnings(done)


def test_parts_in_a_crs_that_is_not_usable_are_skipped_with_its_name(tmp_path: Path) -> None:
    degrees = building("degrees", ring(), "EPSG:4326")
    unknown = building("unknown", ring(), "urn:adv:crs:NOWHERE")
    done, boxes = add(tmp_path, model(building("a", ring()), degrees, unknown))
    assert set(boxes) == {"a"}
    names = ("EPSG:4326", "urn:adv:crs:NOWHERE")
    unusable = [item for item in done.report["findings"] if item["code"] == "part-crs-unusable"]
    assert {item["values"]["name"]: item["count"] for item in unusable} == dict.fromkeys(names, 2)
    examples = {item["values"]["name"]: item["example"] for item in unusable}
    assert re.search("are no degrees", examples[names[0]])
    assert re.search("unknown CRS 'urn:adv:crs:NOWHERE'", examples[names[1]])


def test_a_strict_import_refuses_what_would_be_skipped(tmp_path: Path) -> None:
    text = model(building("a", ring()), building("b", ring(), "urn:adv:crs:NOWHERE"))
    with pytest.raises((CrsError, ImportFailed), match="NOWHERE"):
        add(tmp_path, text, ImportOptions(strict=True))


def test_a_file_of_which_no_part_is_usable_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CrsError, match="unknown CRS 'EPSG:99999'"):
        add(tmp_path, model(building("b", ring(), "EPSG:99999")))


def test_the_crs_of_the_user_counts_for_all_parts(tmp_path: Path) -> None:
    text = model(building("a", ring(), "EPSG:31468"), building("b", ring(dx=20.0), "EPSG:4326"), building("c", ring(dx=40.0), "urn:adv:crs:NOWHERE"))
    done, boxes = add(tmp_path, text, ImportOptions(crs="EPSG:25832"))
    assert np.array_equal(boxes["b"], expected(20.0))
    (said,) = warned(done.report)
    assert said["example"] == "EPSG:31468, EPSG:4326, urn:adv:crs:NOWHERE; read as EPSG:25832"
    same = text.replace("EPSG:4326", "EPSG:31468").replace("urn:adv:crs:NOWHERE", "EPSG::31468")
    done, _ = add(tmp_path / "same", same, ImportOptions(crs="EPSG:25832"))
    assert warned(done.report) == []
