"""RasterReliefs of CityGML: the rasters that they name become terrain, at the place of the grid or at their own."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from pyproj import Transformer
from rasterio.errors import NotGeoreferencedWarning

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import FilesImport, import_files
from map3d.errors import ImportFailed
from map3d.ingest.import_options import ImportOptions
from map3d.messages import message
from map3d.registry import Registry
from map3d.site.files import ImportSummary, SiteFiles, update_files
from tests.findings import skipped, warned

EAST, NORTH, CELL_M = 691000.0, 5336000.0, 25.0
COLUMNS, ROWS = 6, 5
HOUSE = """<core:cityObjectMember><bldg:Building gml:id="house"><bldg:lod1MultiSurface><gml:MultiSurface><gml:surfaceMember><gml:Polygon>
<gml:exterior><gml:LinearRing><gml:posList>691010 5336010 500 691020 5336010 500 691020 5336020 505 691010 5336010 500
</gml:posList></gml:LinearRing></gml:exterior>
</gml:Polygon></gml:surfaceMember></gml:MultiSurface></bldg:lod1MultiSurface></bldg:Building></core:cityObjectMember>"""
MODEL = """<core:CityModel xmlns:core="http://www.opengis.net/citygml/2.0" xmlns:bldg="http://www.opengis.net/citygml/building/2.0"
 xmlns:gml="http://www.opengis.net/gml" xmlns:dem="http://www.opengis.net/citygml/relief/2.0"><gml:boundedBy><gml:Envelope srsName="{crs}">
<gml:lowerCorner>0 0 0</gml:lowerCorner></gml:Envelope></gml:boundedBy>{house}<core:cityObjectMember><dem:ReliefFeature gml:id="relief">
<dem:lod>1</dem:lod><dem:reliefComponent><dem:RasterRelief><dem:lod>1</dem:lod><dem:grid><gml:RectifiedGridCoverage><gml:rectifiedGridDomain>
<gml:RectifiedGrid dimension="2"><gml:limits><gml:GridEnvelope>
<gml:low>0 0</gml:low><gml:high>{columns} {rows}</gml:high></gml:GridEnvelope></gml:limits>
<gml:axisName>x</gml:axisName><gml:axisName>y</gml:axisName><gml:origin><gml:Point{srs}><gml:pos>{origin}</gml:pos></gml:Point></gml:origin><gml:offsetVector>{u}</gml:offsetVector>
<gml:offsetVector>{v}</gml:offsetVector></gml:RectifiedGrid></gml:rectifiedGridDomain><gml:rangeSet><gml:File><gml:rangeParameters/>
<gml:fileName>{file}</gml:fileName><gml:fileStructure>Record Interleaved</gml:fileStructure></gml:File></gml:rangeSet></gml:RectifiedGridCoverage>
</dem:grid></dem:RasterRelief></dem:reliefComponent></dem:ReliefFeature></core:cityObjectMember></core:CityModel>"""
AS_TERRAIN = "relief-raster-read-as-terrain"


def write_model(
    path: Path,
    file: str = "dem.tif",
    house: str = HOUSE,
    crs: str = "EPSG:25832",
    srs: str = "",
    origin: Sequence[float] = (EAST, NORTH),
    vectors: Sequence[Sequence[float]] = ((CELL_M, 0.0), (0.0, -CELL_M)),
    columns: int = COLUMNS,
) -> Path:
    u, v = (" ".join(map(repr, vector)) for vector in vectors)
    path.parent.mkdir(parents=True, exist_ok=True)
    named = f' srsName="{srs}"' if srs else ""
    place = {"origin": " ".join(map(repr, origin)), "u": u, "v": v, "columns": columns - 1, "rows": ROWS - 1}
    path.write_text(MODEL.format(crs=crs, srs=named, file=file, house=house, **place))
    return path


def heights() -> np.ndarray[Any, Any]:
    return 500.0 + np.arange(ROWS)[:, None] * 10.0 + np.arange(COLUMNS)[None, :]


def write_raster(path: Path, transform: Affine | None = None, crs: str | None = None) -> Path:
    place = ({} if transform is None else {"transform": transform}) | ({} if crs is None else {"crs": crs})
    path.parent.mkdir(parents=True, exist_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path, "w", driver="GTiff", width=COLUMNS, height=ROWS, count=1, dtype="float32", **place) as raster:
            raster.write(heights().astype(np.float32), 1)
    return path


def add(tmp_path: Path, files: Sequence[Path], options: ImportOptions | None = None) -> tuple[FilesImport, dict[str, np.ndarray[Any, Any]]]:
    """Returns the import and the boxes of the assets."""
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    try:
        if not catalogue.scenes():
            catalogue.create_scene(SceneRecord("town"))
        done = import_files(workspace, catalogue, "town", files, options or ImportOptions())
        origin = catalogue.scene("town").origin
    finally:
        catalogue.close()
    with Registry(workspace.registry_path("town")) as registry:
        boxes = {name: summary.box for name, summary in registry.asset_summaries().items()}
    return done, {name: np.array(box) + origin for name, box in boxes.items()}


def warned_of(done: FilesImport, asset: str) -> dict[str, str]:
    (report,) = (item.report for item in done.imported if item.asset == asset)
    return {warning["code"]: warning["example"] for warning in warned(report)}


GRID_BOX = np.array([(EAST - 12.5, NORTH - 112.5, 500.0), (EAST + 137.5, NORTH + 12.5, 545.0)])
"""Pixels reach half a cell beyond the points of the grid."""


def test_a_raster_without_a_georeference_lies_where_its_grid_says(tmp_path: Path) -> None:
    write_raster(tmp_path / "city" / "dem.tif")
    done, boxes = add(tmp_path, [write_model(tmp_path / "city" / "town.gml")])
    assert [item.asset for item in done.imported] == ["town", "dem"]
    assert np.array_equal(boxes["dem"], GRID_BOX)
    assert warned_of(done, "town") == {AS_TERRAIN: "dem.tif"}
    assert warned_of(done, "dem") == {}
    assert not list((tmp_path / "workspace" / "scenes" / "town" / "assets" / "dem").glob("placed"))


@pytest.mark.parametrize("order", ["lat, lon", "swapped"])
def test_a_grid_in_degrees_is_read_in_either_order_of_axes(tmp_path: Path, order: str) -> None:
    write_raster(tmp_path / "city" / "dem.tif")
    lon, lat = Transformer.from_crs("EPSG:25832", "EPSG:4326", always_xy=True).transform(EAST, NORTH)
    place = {"origin": (lat, lon), "vectors": ((0.0, 0.0003), (-0.0002, 0.0))}
    if order == "swapped":
        place = {"origin": (lon, lat), "vectors": ((0.0003, 0.0), (0.0, -0.0002))}
    _, boxes = add(tmp_path, [write_model(tmp_path / "city" / "town.gml", srs="EPSG:4326", **place)])
    corners = np.array([(x, y) for x in (lon - 0.00015, lon + 0.00165) for y in (lat + 0.0001, lat - 0.0009)])
    expected = np.array(Transformer.from_crs("EPSG:4326", "EPSG:25832", always_xy=True).transform(*corners.T))
    assert np.abs(boxes["dem"][:, :2] - [expected.min(axis=1), expected.max(axis=1)]).max() < 0.01


def test_a_raster_of_its_own_place_stays_there(tmp_path: Path) -> None:
    here = Affine(CELL_M, 0, EAST - 12.5, 0, -CELL_M, NORTH + 12.5)
    write_raster(tmp_path / "equal" / "dem.tif", here, "EPSG:25832")
    done, boxes = add(tmp_path / "equal", [write_model(tmp_path / "equal" / "town.gml")])
    assert (warned_of(done, "dem"), np.array_equal(boxes["dem"], GRID_BOX)) == ({}, True)

    write_raster(tmp_path / "other" / "dem.tif", Affine(CELL_M, 0, EAST + 987.5, 0, -CELL_M, NORTH + 12.5), "EPSG:25832")
    done, boxes = add(tmp_path / "other", [write_model(tmp_path / "other" / "town.gml")])
    assert warned_of(done, "dem") == {"relief-raster-elsewhere": "dem.tif: 1,000 apart, in units of its CRS"}
    assert np.array_equal(boxes["dem"], GRID_BOX + np.array([1000.0, 0.0, 0.0]))

    write_raster(tmp_path / "bare" / "dem.tif", here)
    done, boxes = add(tmp_path / "bare", [write_model(tmp_path / "bare" / "town.gml", house="")])
    assert (warned_of(done, "dem"), np.array_equal(boxes["dem"], GRID_BOX)) == ({}, True), "its CRS is that of the grid"


def test_a_document_of_heights_alone_is_terrain(tmp_path: Path) -> None:
    city = tmp_path / "city"
    write_raster(city / "dem.tif")
    done, boxes = add(tmp_path, [write_model(city / "town.gml", house="")])
    assert [item.asset for item in done.imported] == ["dem"]
    assert done.ignored == [(str(city / "town.gml"), message("heights-alone"))]
    assert np.array_equal(boxes["dem"], GRID_BOX)


def test_a_photo_is_draped_over_the_heights(tmp_path: Path) -> None:
    city = tmp_path / "city"
    write_raster(city / "dem.tif")
    with rasterio.open(
        city / "photo.tif", "w", driver="GTiff", width=60, height=50, count=3, dtype="uint8", crs="EPSG:25832",
        transform=Affine(2.5, 0, EAST - 12.5, 0, -2.5, NORTH + 12.5),
    ) as photo:  # fmt: skip
        photo.write(np.full((3, 50, 60), 90, np.uint8))
    write_model(city / "town.gml")
    for number, files in enumerate(([city / "town.gml", city / "photo.tif"], [city])):
        done, boxes = add(tmp_path / str(number), files)
        (terrain,) = (item for item in done.imported if item.format == "raster")
        assert terrain.report["rasters"] == {"elevation": 1, "imagery": 1}
        assert np.array_equal(boxes[terrain.asset], GRID_BOX)


def test_rasters_that_do_not_fit_are_named(tmp_path: Path) -> None:
    with pytest.raises(ImportFailed, match=r"Rasters of heights not found: 1\. .* Example: dem\.tif"):
        add(tmp_path / "missing", [write_model(tmp_path / "missing" / "town.gml", house="")])
    done, _ = add(tmp_path / "beside", [write_model(tmp_path / "beside" / "town.gml")])
    (town,) = done.imported
    assert (skipped(town.report), town.report["missing_files"]) == ({"relief-file-not-found": 1}, ["dem.tif"])

    write_raster(tmp_path / "size" / "dem.tif")
    done, _ = add(tmp_path / "size", [write_model(tmp_path / "size" / "town.gml", columns=9)])
    assert [str(reason).partition("dem.tif: ")[2] for _, reason in done.failed] == ["6 × 5 pixels, but the grid of its RasterRelief has 9 × 5 points"]

    (tmp_path / "words").mkdir()
    (tmp_path / "words" / "dem.tif").write_text("no raster")
    done, _ = add(tmp_path / "words", [write_model(tmp_path / "words" / "town.gml")])
    assert [(Path(file).name, "a file of unknown format" in str(reason)) for file, reason in done.failed] == [("dem.tif", True)]


def test_a_site_names_an_image_that_is_no_raster(tmp_path: Path) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    write_model(city / "town.gml", file="dem.png")
    (city / "dem.png").write_bytes(b"\x89PNG")
    summary = update(workspace, city)
    assert summary.imported == ["town"]
    assert [(Path(file).name, "a PNG image without a world file" in str(reason)) for file, reason in summary.failed] == [("dem.png", True)]

    write_raster(city / ".hidden" / "dem.tif")
    write_model(city / "town.gml", file=".hidden/dem.tif")
    assert update(workspace, city).imported == ["town", "dem"]
    assert update(workspace, city).unchanged == ["town", "dem"]


def update(workspace: Workspace, city: Path) -> ImportSummary:
    catalogue = workspace.open_catalogue()
    try:
        return update_files(workspace, catalogue, SiteFiles(SceneRecord("town"), city), lambda *_: None)
    finally:
        catalogue.close()


def test_a_site_imports_the_raster_again_when_its_grid_changes(tmp_path: Path) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    write_raster(city / "dem.tif")
    write_model(city / "town.gml")
    assert update(workspace, city).imported == ["town", "dem"]
    assert update(workspace, city).unchanged == ["town", "dem"]
    write_model(city / "town.gml", origin=(EAST + 100.0, NORTH))
    assert update(workspace, city).imported == ["town", "dem"]
    with Registry(workspace.registry_path("town")) as registry:
        box = registry.asset_summaries()["dem"].box
    catalogue = workspace.open_catalogue()
    assert box is not None
    assert np.allclose(np.array(box) + catalogue.scene("town").origin, GRID_BOX + np.array([100.0, 0.0, 0.0]))
    catalogue.close()
    write_model(city / "town.gml", house="", origin=(EAST + 100.0, NORTH))
    summary = update(workspace, city)
    assert summary.unchanged == ["dem"]
    assert summary.ignored == [("town.gml", message("heights-alone"))]
