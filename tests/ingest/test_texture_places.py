"""Georeferenced textures in another CRS than their surfaces, against pyproj as an oracle."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from pyproj.transformer import TransformerGroup

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d import _core
from map3d.catalogue import SceneRecord, Workspace
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import Imported, import_file
from map3d.ingest.sources import find_sources
from map3d.ingest.texture_places import transform_positions
from tests.findings import skipped, warned

MODEL = """<core:CityModel xmlns:core="http://www.opengis.net/citygml/2.0" xmlns:bldg="http://www.opengis.net/citygml/building/2.0"
 xmlns:gml="http://www.opengis.net/gml" xmlns:app="http://www.opengis.net/citygml/appearance/2.0"><gml:boundedBy><gml:Envelope srsName="{crs}">
<gml:lowerCorner>0 0 0</gml:lowerCorner></gml:Envelope></gml:boundedBy><app:appearanceMember><app:Appearance><app:theme>photo</app:theme>
<app:surfaceDataMember><app:GeoreferencedTexture><app:imageURI>photo.png</app:imageURI><app:wrapMode>none</app:wrapMode>
<app:referencePoint><gml:Point{srs}><gml:pos>{point}</gml:pos></gml:Point></app:referencePoint>{orientation}
<app:target>#p</app:target></app:GeoreferencedTexture></app:surfaceDataMember></app:Appearance></app:appearanceMember><core:cityObjectMember>
<bldg:Building gml:id="b"><bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember><gml:Polygon gml:id="p"><gml:exterior><gml:LinearRing>
<gml:posList>{ring}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface>
</bldg:Building></core:cityObjectMember></core:CityModel>"""
WIDTH, HEIGHT = 400, 300
SURFACE = np.array([(691010.0, 5336010.0), (691050.0, 5336012.0), (691048.0, 5336040.0), (691012.0, 5336038.0)])
UNUSED = "georeferenced-texture-inexact"


def to(crs: str, points: Any) -> Any:
    """Returns (n, 2) positions in `crs`, east first, of positions in the CRS of the surfaces: by the most accurate operation that is installed."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a better one is not installed
        operation = TransformerGroup(crs, "EPSG:25832", always_xy=True, allow_ballpark=False).transformers[0]
    return np.array(operation.transform(*points.T, direction="INVERSE")).T


def add(
    folder: Path,
    srs: str,
    origin: Any,
    steps: Any,
    *,
    lat_first: bool = False,
    world_file: bool = False,
    options: ImportOptions | None = None,
) -> tuple[Imported, Any, Any]:
    """Imports a polygon with a texture: `origin` is the centre of its upper left pixel, the rows of `steps` are those along columns and rows, all
    east first. Returns the positions of the triangles' corners and their texture coordinates, both (n, 2)."""
    folder.mkdir()
    Image.new("RGB", (WIDTH, HEIGHT), (90, 120, 60)).save(folder / "photo.png")
    order = [1, 0] if lat_first else [0, 1]
    point, (column, row) = origin[order], steps[:, order]
    matrix = f"{column[0]!r} {row[0]!r} {column[1]!r} {row[1]!r}".replace("np.float64(", "").replace(")", "")
    if world_file:
        numbers = (column[0], column[1], row[0], row[1], *point)
        (folder / "photo.pgw").write_text("\n".join(str(float(number)) for number in numbers))
    ring = " ".join(f"{x} {y} 500" for x, y in [*SURFACE, SURFACE[0]])
    place = {"srs": f' srsName="{srs}"', "point": f"{point[0]:.12f} {point[1]:.12f}", "crs": "EPSG:25832", "ring": ring}
    (folder / "a.gml").write_text(MODEL.format(orientation="" if world_file else f"<app:orientation>{matrix}</app:orientation>", **place))
    workspace = Workspace(folder / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    done = import_file(workspace, catalogue, "town", find_sources([folder / "a.gml"])[0], options or ImportOptions())
    catalogue.close()
    mesh = _core.AssetMesh(str(workspace.asset_folder("town", "a") / "mesh.m3a"))
    return done, mesh.positions[mesh.triangles.ravel(), :2], mesh.uvs.reshape(-1, 2)


def expected(srs: str, origin: np.ndarray[Any, Any], steps: np.ndarray[Any, Any], corners: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Returns the texture coordinates of surface corners, each transformed by pyproj on its own."""
    pixels = (to(srs, corners) - origin) @ np.linalg.inv(steps)
    return np.column_stack([(pixels[:, 0] + 0.5) / WIDTH, 1.0 - (pixels[:, 1] + 0.5) / HEIGHT])


def steps_in(srs: str, size_m: float) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Returns origin and steps of a texture around the surface with pixels of this size, along the axes of `srs`."""
    middle = SURFACE.mean(axis=0)
    corners = to(srs, middle + np.array([(0.0, 0.0), (size_m, 0.0), (0.0, -size_m)]))
    steps = np.array([(corners[1, 0] - corners[0, 0], 0.0), (0.0, corners[2, 1] - corners[0, 1])])
    return corners[0] - steps[0] * WIDTH / 2 - steps[1] * HEIGHT / 2, steps


@pytest.mark.parametrize("world_file", [False, True])
@pytest.mark.parametrize(
    ("srs", "lat_first"), [("EPSG:31468", False), ("EPSG:25833", False), ("EPSG:4326", True), ("urn:ogc:def:crs:OGC:1.3:CRS84", False)]
)
def test_the_texture_lies_where_pyproj_says(tmp_path: Path, srs: str, lat_first: bool, world_file: bool) -> None:
    origin, steps = steps_in(srs, 0.2)
    done, corners, uvs = add(tmp_path / "a", srs, origin, steps, lat_first=lat_first, world_file=world_file)
    assert warned(done.report) == []
    assert len(uvs) == 6
    error_px = np.abs((uvs - expected(srs, origin, steps, corners)) * (WIDTH, HEIGHT)).max()
    assert error_px < 0.05, "an affine map is all but exact for 80 m"
    assert np.ptp(uvs, axis=0).min() > 0.3


def test_a_texture_that_no_affine_map_reaches_is_not_used(tmp_path: Path) -> None:
    origin, steps = steps_in("EPSG:4326", 500.0)
    done, _, uvs = add(tmp_path / "a", "EPSG:4326", origin, steps, lat_first=True)
    assert {warning["code"]: warning["count"] for warning in warned(done.report)} == {UNUSED: 1}
    assert not uvs.any()


def test_a_texture_elsewhere_is_counted_if_no_transformation_is_known(tmp_path: Path) -> None:
    origin, steps = steps_in("EPSG:31468", 0.2)
    done, _, _ = add(tmp_path / "a", "#local", origin, steps)
    assert [warning["code"] for warning in warned(done.report)] == ["georeferenced-texture-in-other-crs"]


def test_a_stated_crs_holds_for_textures_too(tmp_path: Path) -> None:
    origin, steps = steps_in("EPSG:25832", 0.2)
    done, corners, uvs = add(tmp_path / "a", "EPSG:31468", origin, steps, options=ImportOptions(crs="EPSG:25832"))
    assert np.abs((uvs - expected("EPSG:25832", origin, steps, corners)) * (WIDTH, HEIGHT)).max() < 0.01
    assert skipped(done.report) == {}


def test_positions_are_in_the_order_of_documents() -> None:
    (east, north) = to("EPSG:4326", SURFACE[:1])[0]
    assert np.allclose(transform_positions("EPSG:4326", "EPSG:25832", [(north, east)]), SURFACE[:1], atol=1e-3)
    assert np.allclose(transform_positions("EPSG:25832", "EPSG:4326", SURFACE[:1].tolist()), [(north, east)], atol=1e-9)
    assert transform_positions("EPSG:25832", "nowhere", [(0.0, 0.0)]) is None
    assert not np.isfinite(transform_positions("EPSG:4326", "EPSG:25832", [(np.inf, 0.0)])).any()
