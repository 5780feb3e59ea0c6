"""Virtual rasters (VRT): those that the operator names are read, with rasters of one folder only; all others are refused with a reason."""

import os
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rasterio.shutil import copy

pytest.importorskip("map3d._core", reason="the compiled core is not built")

import map3d
from map3d.catalogue import Catalogue, SceneRecord, Workspace
from map3d.coherence.import_files import FilesImport, import_files
from map3d.errors import ImportFailed, UnknownFormat
from map3d.ingest.import_inputs import import_inputs
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.sources import find_sources
from map3d.ingest.virtual_raster import check_virtual_raster, find_virtual_sources, is_checked
from map3d.site.files import SiteFiles, update_files
from tests.ingest.terrain.rasters import hills, write

OPERATOR = ImportOptions(virtual_rasters=True)
BAND = '<VRTRasterBand dataType="Float32" band="1"{attributes}>{before}<SimpleSource><SourceFilename {relative}>{name}</SourceFilename>'
BAND += "<SourceBand>1</SourceBand></SimpleSource></VRTRasterBand>"


def write_virtual(
    path: Path, name: str, relative: str = 'relativeToVRT="1"', before: str = "", attributes: str = "", dataset: str = "", head: str = ""
) -> Path:
    band = BAND.format(attributes=attributes, before=before, relative=relative, name=name)
    place = "<GeoTransform>691000, 1, 0, 5336000, 0, -1</GeoTransform>"
    path.write_text(f'{head}<VRTDataset rasterXSize="20" rasterYSize="20"{dataset}><SRS>EPSG:25832</SRS>{place}{band}</VRTDataset>')
    return path


@pytest.fixture
def city(tmp_path: Path) -> Path:
    """A folder with tiles and a virtual raster of them."""
    folder = tmp_path / "city"
    (folder / "tiles").mkdir(parents=True)
    write(folder / "tiles" / "dem.tif", hills(20, 20))
    return folder


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path / "workspace").create()


@pytest.fixture
def catalogue(workspace: Workspace) -> Iterator[Catalogue]:
    opened = workspace.open_catalogue()
    opened.create_scene(SceneRecord("town"))
    yield opened
    opened.close()


def add(workspace: Workspace, catalogue: Catalogue, *paths: Path, options: ImportOptions = OPERATOR) -> FilesImport:
    return import_files(workspace, catalogue, "town", paths, options)


def heights(workspace: Workspace, name: str) -> np.ndarray:  # type: ignore[type-arg]
    return np.unique(map3d._core.AssetMesh(str(workspace.asset_folder("town", name) / "mesh.m3a")).positions[:, 2])


def test_a_virtual_raster_that_the_operator_names_equals_its_raster(workspace: Workspace, catalogue: Catalogue, city: Path) -> None:
    copy(city / "tiles" / "dem.tif", city / "tiles" / "all.vrt", driver="VRT")
    add(workspace, catalogue, city / "tiles" / "all.vrt")
    add(workspace, catalogue, city / "tiles" / "dem.tif")
    assert np.array_equal(heights(workspace, "all"), heights(workspace, "dem"))


def test_a_virtual_raster_in_a_given_folder_stands_for_its_tiles(workspace: Workspace, catalogue: Catalogue, city: Path) -> None:
    write_virtual(city / "dem.vrt", "tiles/dem.tif")
    (done,) = add(workspace, catalogue, city).imported
    assert (done.asset, done.report["rasters"]) == ("dem", {"elevation": 1, "imagery": 0})
    assert done.triangles == 2 * 21 * 21
    assert done.report["bytes"] > (city / "tiles" / "dem.tif").stat().st_size


def test_the_folder_of_a_virtual_raster_may_have_other_virtual_rasters(workspace: Workspace, catalogue: Catalogue, city: Path) -> None:
    write_virtual(city / "tiles" / "inner.vrt", "dem.tif")
    write_virtual(city / "dem.vrt", "tiles/inner.vrt")
    assert add(workspace, catalogue, city / "dem.vrt").imported[0].triangles == 2 * 21 * 21


def test_a_changed_tile_changes_the_inputs_of_a_virtual_raster(city: Path) -> None:
    virtual = write_virtual(city / "dem.vrt", "tiles/dem.tif")

    def digest() -> str:
        return import_inputs(find_sources([virtual], virtual=[virtual])[0], OPERATOR).digest

    before = digest()
    assert digest() == before
    write(city / "tiles" / "dem.tif", hills(20, 20) + 1)
    assert digest() != before


@pytest.mark.parametrize("name", ["other", "town/tiles/../../other"])
def test_a_virtual_raster_reads_nothing_outside_the_folder(workspace: Workspace, catalogue: Catalogue, city: Path, name: str) -> None:
    write(city.parent / "other.tif", hills(20, 20))
    (city / "town" / "tiles").mkdir(parents=True)
    write_virtual(city / "dem.vrt", f"../{name}.tif" if name == "other" else f"{name}.tif".replace("other", "../other"))
    with pytest.raises(ImportFailed, match="outside the folder"):
        add(workspace, catalogue, city / "dem.vrt")


def test_a_link_does_not_lead_out_of_the_folder(workspace: Workspace, catalogue: Catalogue, city: Path) -> None:
    write(city.parent / "other.tif", hills(20, 20))
    (city / "link.tif").symlink_to(city.parent / "other.tif")
    write_virtual(city / "dem.vrt", "link.tif")
    with pytest.raises(ImportFailed, match="outside the folder"):
        add(workspace, catalogue, city / "dem.vrt")


def test_an_absolute_path_may_lie_in_the_folder_only(city: Path) -> None:
    inside = write_virtual(city / "dem.vrt", str(city / "tiles" / "dem.tif"), 'relativeToVRT="0"')
    check_virtual_raster(inside, city)
    assert is_checked(inside)
    with pytest.raises(ImportFailed, match="outside the folder"):
        check_virtual_raster(inside, city / "elsewhere")


REFUSED = {
    "address": ({"name": "https://example.org/dem.tif"}, "not the path of a file"),
    "vsi": ({"name": "/vsicurl/https://example.org/dem.tif"}, "not the path of a file"),
    "vsizip": ({"name": "/vsizip/dem.zip/dem.tif"}, "not the path of a file"),
    "driver": ({"name": "GTIFF_DIR:1:tiles/dem.tif"}, "not the path of a file"),
    "inline": ({"name": "&lt;VRTDataset/&gt;"}, "not the path of a file"),
    "empty": ({"name": " "}, "not the path of a file"),
    "absent": ({"name": "tiles/none.tif"}, "is not there"),
    "long": ({"name": "x" * 5000}, "cannot be found"),
    "other format": ({"name": "notes.txt"}, "not a raster that map3d reads"),
    "relative": ({"name": "tiles/dem.tif", "relative": 'relativeToVRT="01"'}, "neither 0 nor 1"),
    "pixel function": ({"name": "tiles/dem.tif", "attributes": ' subClass="VRTDerivedRasterBand"'}, "pixel function"),
    "other case": ({"name": "tiles/dem.tif", "attributes": ' subclass="VRTDerivedRasterBand"'}, "pixel function"),
    "python": ({"name": "tiles/dem.tif", "before": "<PixelFunctionCode>import os</PixelFunctionCode>"}, "pixel function"),
    "raw": ({"name": "tiles/dem.tif", "attributes": ' subClass="VRTRawRasterBand"'}, "kind VRTRawRasterBand"),
    "warped": ({"name": "tiles/dem.tif", "dataset": ' subClass="VRTWarpedDataset"'}, "kind VRTWarpedDataset"),
    "options": ({"name": "tiles/dem.tif", "before": "<OpenOptions/>"}, "element OpenOptions"),
    "lower case": ({"name": "tiles/dem.tif", "before": "<sourcefilename>/etc/passwd</sourcefilename>"}, "element sourcefilename"),
    "metadata": ({"name": "tiles/dem.tif", "before": '<Metadata domain="new_vrt_sources"/>'}, "element Metadata"),
    "entities": ({"name": "tiles/dem.tif", "head": '<!DOCTYPE VRTDataset [<!ENTITY a "b">]>'}, "document type"),
    "broken": ({"name": "tiles/dem.tif", "before": "<LUT>"}, "broken virtual raster"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_anything_but_files_of_the_folder_is_refused(workspace: Workspace, catalogue: Catalogue, city: Path, case: str) -> None:
    parts, reason = REFUSED[case]
    (city / "notes.txt").write_text("just some words")
    write_virtual(city / "dem.vrt", **parts)
    with pytest.raises(ImportFailed, match=reason) as refused:
        add(workspace, catalogue, city / "dem.vrt")
    assert "dem.vrt" in str(refused.value)


def test_virtual_rasters_that_name_each_other_are_refused(city: Path) -> None:
    write_virtual(city / "a.vrt", "b.vrt")
    write_virtual(city / "b.vrt", "a.vrt")
    with pytest.raises(ImportFailed, match="virtual rasters of virtual rasters"):
        check_virtual_raster(city / "a.vrt", city)
    assert find_virtual_sources(city / "a.vrt", city) == {(city / "b.vrt").resolve()}


def test_a_nested_virtual_raster_is_checked_too(city: Path) -> None:
    write_virtual(city / "inner.vrt", "tiles/dem.tif", attributes=' subClass="VRTDerivedRasterBand"')
    with pytest.raises(ImportFailed, match=r"inner\.vrt: .*pixel function"):
        check_virtual_raster(write_virtual(city / "dem.vrt", "inner.vrt"), city)


def test_one_that_a_web_user_uploads_is_refused(workspace: Workspace, catalogue: Catalogue, city: Path) -> None:
    """Operations of the web interface use the default options."""
    virtual = write_virtual(city / "dem.vrt", "tiles/dem.tif")
    with pytest.raises(UnknownFormat, match="only on its own command line"):
        add(workspace, catalogue, virtual, options=ImportOptions())
    done = add(workspace, catalogue, city, options=ImportOptions())
    assert [item.asset for item in done.imported] == ["dem"]
    ((path, reason),) = done.ignored
    assert (os.path.basename(path), "virtual raster" in str(reason)) == ("dem.vrt", True)


def test_one_in_an_archive_is_refused_even_if_the_operator_gives_it(workspace: Workspace, catalogue: Catalogue, city: Path) -> None:
    virtual = write_virtual(city / "dem.vrt", "tiles/dem.tif")
    with zipfile.ZipFile(city.parent / "city.zip", "w") as archive:
        archive.write(virtual, "dem.vrt")
        archive.write(city / "tiles" / "dem.tif", "tiles/dem.tif")
    done = add(workspace, catalogue, city.parent / "city.zip")
    assert [item.source.endswith("dem.tif") for item in done.imported] == [True]
    assert len(done.ignored) == 1


def test_a_site_reads_one_and_notices_changed_tiles(workspace: Workspace, catalogue: Catalogue, city: Path) -> None:
    write_virtual(city / "dem.vrt", "tiles/dem.tif")
    site = SiteFiles(SceneRecord("town"), city, OPERATOR)
    assert update_files(workspace, catalogue, site, lambda *_: None).imported == ["dem"]
    assert update_files(workspace, catalogue, site, lambda *_: None).unchanged == ["dem"]
    write(city / "tiles" / "dem.tif", hills(20, 20) + 1)
    assert update_files(workspace, catalogue, site, lambda *_: None).again == {"dem": "the file changed"}
    assert [asset.source for asset in catalogue.assets("town")] == [str(city / "dem.vrt")]


def test_the_library_reads_one(city: Path, tmp_path: Path) -> None:
    virtual = write_virtual(city / "dem.vrt", "tiles/dem.tif")
    with map3d.open_workspace(tmp_path / "library", create=True) as library:
        assert library.create_scene("town").add_files(virtual).imported[0].triangles == 2 * 21 * 21
