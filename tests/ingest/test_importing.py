"""Imports of hand-written files."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from map3d.catalogue import Catalogue, SceneRecord, Workspace
from map3d.errors import CrsError, ImportFailed, LimitExceeded, NotFound
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import Imported, import_file
from map3d.ingest.sources import find_sources
from map3d.registry import Registry
from map3d.scenes.scene_files import check_file
from tests.findings import skipped, warned
from tests.ingest.terrain.rasters import hills, write

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

BOX_OBJ = "o box\nv 0 0 0\nv 2 0 0\nv 2 3 0\nv 0 3 0\nv 0 0 4\nf 1 2 3 4\nf 1 2 5\n"
GML = """<?xml version="1.0" encoding="UTF-8"?>
<core:CityModel xmlns:core="http://www.opengis.net/citygml/2.0" xmlns:bldg="http://www.opengis.net/citygml/building/2.0"
 xmlns:gml="http://www.opengis.net/gml" xmlns:xlink="http://www.w3.org/1999/xlink">
{buildings}
</core:CityModel>
"""
BUILDING = """<core:cityObjectMember><bldg:Building gml:id="{name}"><bldg:lod2MultiSurface><gml:MultiSurface{srs}><gml:surfaceMember>
<gml:Polygon><gml:exterior><gml:LinearRing><gml:posList srsDimension="3">{ring}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon>
</gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface></bldg:Building></core:cityObjectMember>
"""
UTM_RING = "691010 5336010 510 691020 5336010 510 691020 5336020 515 691010 5336020 515 691010 5336010 510"
LAT_LON_RING = "48.1 11.6 510 48.1 11.6001 510 48.1001 11.6001 515 48.1001 11.6 515 48.1 11.6 510"
UTM = ' srsName="urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH" srsDimension="3"'


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path / "workspace").create()


@pytest.fixture
def catalogue(workspace: Workspace) -> Iterator[Catalogue]:
    opened = workspace.open_catalogue()
    opened.create_scene(SceneRecord("town"))
    yield opened
    opened.close()


def gml(*buildings: tuple[str, str, str]) -> str:
    return GML.format(buildings="".join(BUILDING.format(name=name, ring=ring, srs=srs) for name, ring, srs in buildings))


def add(workspace: Workspace, catalogue: Catalogue, path: Path, text: str, options: ImportOptions | None = None, scene: str = "town") -> Imported:
    path.write_text(text)
    return import_file(workspace, catalogue, scene, find_sources([path])[0], options or ImportOptions())


def boxes(workspace: Workspace, scene: str = "town") -> dict[str, object]:
    with Registry(workspace.registry_path(scene)) as registry:
        return {item.name: item.box for item in registry.objects() if item.box is not None}


def test_an_obj_in_local_metres(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    done = add(workspace, catalogue, tmp_path / "House 1.obj", BOX_OBJ)
    assert (done.asset, done.format, done.triangles, done.replaced) == ("house-1", "obj", 3, False)
    scene = catalogue.scene("town")
    assert scene.origin == (0.0, 0.0, 0.0)
    assert scene.crs is not None
    assert scene.crs.is_local
    assert list(boxes(workspace).values()) == [((0.0, 0.0, 0.0), (2.0, 3.0, 4.0))]
    folder = workspace.asset_folder("town", "house-1")
    assert check_file(folder / "mesh.m3a") is None
    assert len(np.fromfile(folder / "ids.u32", "<u4")) == done.objects
    assert json.loads((folder / "report.json").read_text())["placing"]["to"] == "local metres"
    assert [path.name for path in folder.parent.iterdir()] == ["house-1"]


def test_the_first_citygml_file_pins_crs_and_origin(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    add(workspace, catalogue, tmp_path / "a.gml", gml(("B1", UTM_RING, UTM)))
    scene = catalogue.scene("town")
    assert scene.crs is not None
    assert (scene.crs.epsg, scene.crs.vertical) == (25832, "DHHN2016 height")
    assert scene.origin == (691_000.0, 5_336_000.0, 500.0)
    assert boxes(workspace)["B1"] == ((10.0, 10.0, 10.0), (20.0, 20.0, 15.0))


def test_later_files_keep_the_origin(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    add(workspace, catalogue, tmp_path / "a.gml", gml(("B1", UTM_RING, UTM)))
    add(workspace, catalogue, tmp_path / "b.gml", gml(("B2", UTM_RING.replace("6910", "6950"), UTM)))
    assert catalogue.scene("town").origin == (691_000.0, 5_336_000.0, 500.0)
    assert boxes(workspace)["B2"] == ((4010.0, 10.0, 10.0), (4020.0, 20.0, 15.0))


def test_geographic_coordinates_are_transformed_to_the_scenes_crs(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    add(workspace, catalogue, tmp_path / "a.gml", gml(("B1", LAT_LON_RING, ' srsName="urn:ogc:def:crs:EPSG::4979"')))
    scene = catalogue.scene("town")
    assert scene.crs is not None
    assert scene.crs.name == "WGS 84 / UTM zone 32N"
    ((low, high),) = boxes(workspace).values()  # type: ignore[misc]
    assert high[0] - low[0] == pytest.approx(7.44 + 0.35, abs=0.6)  # 0.0001° of longitude at 48° north, rotated by the meridian convergence
    assert high[1] - low[1] == pytest.approx(11.12 + 0.25, abs=0.6)
    report = catalogue.assets("town")[0].report
    assert "unchanged" in report["placing"]["heights"]


def test_ids_stay_when_a_file_is_imported_again(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    add(workspace, catalogue, tmp_path / "a.gml", gml(("B1", UTM_RING, UTM), ("B2", UTM_RING, UTM)))
    with Registry(workspace.registry_path("town")) as registry:
        before = registry.ids_by_name("a")
    done = add(workspace, catalogue, tmp_path / "a.gml", gml(("B3", UTM_RING, UTM), ("B2", UTM_RING, UTM)))
    with Registry(workspace.registry_path("town")) as registry:
        after = registry.ids_by_name("a")
        assert registry.get(before["B1"]) is None
    assert done.replaced
    assert after["B2"] == before["B2"]
    assert after["B3"] not in before.values()


def test_a_broken_building_is_skipped_and_counted(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    text = gml(("B1", "1 2 3 4 5", UTM), ("B2", UTM_RING, UTM), ("B3", "0 0 0 0 0 0 0 0 0 0 0 0", UTM))
    done = add(workspace, catalogue, tmp_path / "a.gml", text)
    assert list(boxes(workspace)) == ["B2"]
    assert sum(skipped(done.report).values()) >= 2
    with pytest.raises(ImportFailed):
        add(workspace, catalogue, tmp_path / "b.gml", text, ImportOptions(strict=True))
    assert [asset.name for asset in catalogue.assets("town")] == ["a"]


def test_a_failed_import_leaves_the_earlier_asset(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    add(workspace, catalogue, tmp_path / "a.gml", gml(("B1", UTM_RING, UTM)))
    before = (boxes(workspace), catalogue.assets("town"))
    with pytest.raises(ImportFailed, match="no usable triangle"):
        add(workspace, catalogue, tmp_path / "a.gml", gml(("B1", "0 0 0 0 0 0", UTM)))
    with pytest.raises(ImportFailed):
        add(workspace, catalogue, tmp_path / "a.gml", gml(("B1", UTM_RING, UTM))[:500])
    assert (boxes(workspace), catalogue.assets("town")) == before


def test_a_file_without_a_crs_needs_the_crs_option(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    text = gml(("B1", UTM_RING, ""))
    with pytest.raises(CrsError, match="--crs"):
        add(workspace, catalogue, tmp_path / "a.gml", text)
    assert catalogue.scene("town").crs is None
    add(workspace, catalogue, tmp_path / "a.gml", text, ImportOptions(crs="EPSG:25832"))
    crs = catalogue.scene("town").crs
    assert crs is not None
    assert crs.epsg == 25832


def test_an_unknown_crs_error_names_the_crs_option(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    text = gml(("B1", UTM_RING, ' srsName="urn:adv:crs:NOWHERE"'))
    with pytest.raises(CrsError, match=r"NOWHERE.*--crs"):
        add(workspace, catalogue, tmp_path / "a.gml", text)
    add(workspace, catalogue, tmp_path / "a.gml", text, ImportOptions(crs="EPSG:25832"))


def test_a_local_scene_refuses_georeferenced_files(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    add(workspace, catalogue, tmp_path / "a.obj", BOX_OBJ)
    with pytest.raises(CrsError, match="another scene"):
        add(workspace, catalogue, tmp_path / "b.gml", gml(("B1", UTM_RING, UTM)))


def test_a_raster_takes_the_stated_crs(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    source = find_sources([write(tmp_path / "dem.tif", hills(4, 4), crs=None)])[0]
    report = import_file(workspace, catalogue, "town", source, ImportOptions(crs="EPSG:25832")).report
    crs = catalogue.scene("town").crs
    assert crs is not None
    assert (crs.epsg, report["placing"]["from"], warned(report)) == (25832, "ETRS89 / UTM zone 32N", [])


def test_a_local_scene_refuses_a_raster_with_a_stated_crs(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    add(workspace, catalogue, tmp_path / "a.obj", BOX_OBJ)
    source = find_sources([write(tmp_path / "dem.tif", hills(4, 4))])[0]
    with pytest.raises(CrsError, match="local metres"):
        import_file(workspace, catalogue, "town", source, ImportOptions(crs="EPSG:25832"))
    import_file(workspace, catalogue, "town", source, ImportOptions(crs="local"))


def test_files_far_from_the_scene_are_refused(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    add(workspace, catalogue, tmp_path / "a.obj", BOX_OBJ)
    with pytest.raises((LimitExceeded, ImportFailed)):
        add(workspace, catalogue, tmp_path / "b.obj", BOX_OBJ.replace("v 2", "v 200000002").replace("v 0", "v 200000000"))


def test_importing_into_an_absent_scene_raises_not_found(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    with pytest.raises(NotFound):
        add(workspace, catalogue, tmp_path / "a.obj", BOX_OBJ, scene="nowhere")


def test_y_up_files_are_rotated(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    add(workspace, catalogue, tmp_path / "a.obj", BOX_OBJ, ImportOptions(up="y"))
    assert list(boxes(workspace).values()) == [((0.0, -4.0, 0.0), (2.0, 0.0, 3.0))]


def test_rooms_are_drawn_on_request(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    surface = BUILDING.partition("<bldg:lod2")[2].partition("</bldg:Building>")[0]
    room = f"<bldg:interiorRoom><bldg:Room><bldg:lod2{surface}</bldg:Room></bldg:interiorRoom></bldg:Building>"
    text = gml(("B1", UTM_RING, UTM)).replace("</bldg:Building>", room.format(ring=UTM_RING.replace("691010", "691011"), srs=""))
    done = add(workspace, catalogue, tmp_path / "a.gml", text)
    assert (done.triangles, skipped(done.report)) == (2, {"polygon-of-interior": 1})
    (said,) = [warning for warning in warned(done.report) if warning["code"] == "interiors-not-drawn"]
    assert said["example"] == "1; --interiors draws them"
    done = add(workspace, catalogue, tmp_path / "a.gml", text, ImportOptions(interiors=True))
    assert (done.triangles, done.replaced, skipped(done.report)) == (4, True, {})


def test_codes_have_the_names_of_their_list(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    (tmp_path / "city" / "codelists").mkdir(parents=True)
    entry = "<dictionaryEntry><Definition><description>house</description><name>411</name></Definition></dictionaryEntry>"
    (tmp_path / "city" / "codelists" / "use.xml").write_text(f"<Dictionary>{entry}</Dictionary>")
    usage = "<bldg:usage codeSpace='../codelists/use.xml'>411</bldg:usage><bldg:lod2MultiSurface>"
    (tmp_path / "city" / "udx").mkdir()
    path = tmp_path / "city" / "udx" / "a.gml"
    path.write_text(gml(("B1", UTM_RING, UTM)).replace("<bldg:lod2MultiSurface>", usage))
    for folder, expected in ((path, {"usage": "411"}), (tmp_path / "city", {"usage": "house", "usage/code": "411"})):
        import_file(workspace, catalogue, "town", find_sources([folder])[0], ImportOptions())
        with Registry(workspace.registry_path("town")) as registry:
            (found,) = [item.attributes for item in registry.objects() if item.name == "B1"]
        assert found == expected


def test_the_same_file_has_the_same_versions_on_every_later_day(tmp_path: Path, workspace: Workspace, catalogue: Catalogue) -> None:
    building = '<bldg:Building gml:id="a">'
    both = gml(("a", UTM_RING, UTM), ("b", UTM_RING.replace("6910", "6911"), UTM))
    text = both.replace(building, f"{building}<core:terminationDate>2100-01-01</core:terminationDate>")
    done = add(workspace, catalogue, tmp_path / "a.gml", text)
    assert (done.objects, len(done.report["versions_on"])) == (2, 10)
    (asset,) = catalogue.assets("town")
    catalogue.put_asset(replace(asset, report={**asset.report, "versions_on": "2100-01-02"}))
    again = add(workspace, catalogue, tmp_path / "a.gml", text)
    assert (again.objects, again.report["versions_on"]) == (1, "2100-01-02"), "as on the day of its first import"
    changed = add(workspace, catalogue, tmp_path / "a.gml", text + "\n")
    assert (changed.objects, changed.report["versions_on"]) == (2, done.report["versions_on"]), "another file, another day"
    assert "versions_on" not in add(workspace, catalogue, tmp_path / "a.gml", both).report, "no object has an end"
