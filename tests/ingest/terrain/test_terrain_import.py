import json
import os
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from PIL import Image
from pyproj import CRS, Transformer
from rasterio.enums import ColorInterp
from rasterio.shutil import copy

from map3d.errors import BadRequest, CrsError, ImportFailed, LimitExceeded, NotFound, Stopped
from map3d.ingest.findings import finding
from map3d.ingest.terrain import terrain_rasters
from map3d.ingest.terrain.height_tint import COLOURS
from map3d.ingest.terrain.terrain_import import import_terrain
from map3d.ingest.terrain.terrain_options import TerrainOptions
from tests.findings import skipped, warned
from tests.ingest.terrain.rasters import NORTH, WEST, RecordingWriter, colours, from_bounds, hills, pixel_of, write

UTM = CRS.from_epsg(25832)
NAN_LAYER = float(np.float32(-3.4e38))


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "asset"


def run(dem, ortho, folder, scene_crs=UTM, **options):
    writer = RecordingWriter()
    report = import_terrain(dem, ortho, folder, scene_crs, TerrainOptions(**options), writer=writer)
    assert writer.finished
    assert json.loads((folder / "report.json").read_text()) == report
    return writer, report


@lru_cache(maxsize=64)
def pixels(path, mode=None):
    with Image.open(path) as image:
        return np.asarray(image.convert(mode) if mode else image)


def sides(folder):
    """Returns the sides of all textures in pixels."""
    return [side for path in (folder / "textures").iterdir() for side in pixels(path).shape[:2]]


def sample(folder, material, uv):
    """Returns the texel at a texture coordinate: v up, (0, 0) lower left."""
    image = pixels(next((folder / "textures").glob(f"{material['texture']}.*")), "RGB")
    height, width = image.shape[:2]
    return image[min(int((1 - uv[1]) * height), height - 1), min(int(uv[0] * width), width - 1)]


def up_triangles(writer):
    soup = writer.soup()
    return np.cross(soup[:, 1] - soup[:, 0], soup[:, 2] - soup[:, 0])[:, 2] > 0


def test_heights_are_at_pixel_centres_and_terrain_reaches_the_edge(tmp_path, folder):
    data = hills(20, 30)
    writer, _ = run(write(tmp_path / "dem.tif", data, 2.0), None, folder)
    points = {(x, y): z for positions, *_ in writer.meshes for x, y, z in positions.tolist()}
    for row in range(20):
        for column in range(30):
            assert points[(WEST + 2 * column + 1, NORTH - 2 * row - 1)] == float(data[0, row, column])
    xs, ys = {x for x, _ in points}, {y for _, y in points}
    assert (min(xs), max(xs), min(ys), max(ys)) == (WEST, WEST + 60, NORTH - 40, NORTH)
    assert writer.triangle_count == 2 * 21 * 31


@pytest.mark.parametrize("error", [0.0, 0.5])
def test_tiles_share_border_vertices_without_cracks(tmp_path, folder, error):
    writer, _ = run(write(tmp_path / "dem.tif", hills(70, 90), 1.0), None, folder, tile_cells=16, max_error_m=error)
    assert len(writer.objects) == 5 * 6
    soup = writer.soup()
    _, number = np.unique(soup.reshape(-1, 3), axis=0, return_inverse=True)
    triangles = number.reshape(-1, 3)
    pairs = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    _, uses = np.unique(pairs, axis=0, return_counts=True)
    assert uses.max() == 2
    assert (uses == 1).sum() == 2 * (71 + 91)
    assert up_triangles(writer).all()


def test_objects_are_terrain_tiles_named_by_row_and_column(tmp_path, folder):
    writer, report = run(write(tmp_path / "dem.tif", hills(20, 40)), None, folder, tile_cells=32, name="ground")
    assert [one["name"] for one in writer.objects] == ["ground-0-0", "ground-0-1"]
    assert {one["class"] for one in writer.objects} == {"terrain"}
    assert [mesh[4] for mesh in writer.meshes] == [0, 1]
    assert {mesh[5] for mesh in writer.meshes} == {0}
    assert (report["format"], report["objects"]) == ("terrain", 2)
    assert "25832" in report["crs"]


def test_terrain_without_a_photo_has_the_colours_of_its_heights(tmp_path, folder):
    slope = np.broadcast_to(np.linspace(100.0, 300.0, 201)[None, None, :], (1, 40, 201)).astype(np.float32)
    writer, _ = run(write(tmp_path / "dem.tif", slope), None, folder, tile_cells=16)
    (material,) = writer.materials
    assert [path.stem for path in (folder / "textures").iterdir()] == [material["texture"]]
    assert (material["diffuse"], material["wrap"]) == ([1.0, 1.0, 1.0, 1.0], "clamp")
    parts, ramp = [part for part, _ in COLOURS], np.array([colour for _, colour in COLOURS])
    for positions, triangles, uvs, *_ in writer.meshes:
        for height, uv in zip(positions[triangles].reshape(-1, 3)[::7, 2], uvs.reshape(-1, 2)[::7], strict=True):
            expected = [np.interp((height - 101.0) / 198.0, parts, ramp[:, channel]) for channel in range(3)]
            np.testing.assert_allclose(sample(folder, material, uv), expected, atol=3)


def test_flat_terrain_without_a_photo_stays_green_and_gaps_do_not_matter(tmp_path, folder):
    data = hills(40, 40) * 0 + 7
    data[0, :, :25] = np.nan
    writer, _ = run(write(tmp_path / "dem.tif", data), None, folder, tile_cells=16)
    red, green, blue = sample(folder, writer.materials[0], writer.meshes[0][2].reshape(-1, 2)[0])
    assert green > red
    assert green > blue


def check_colours(writer, folder, colour_at, tolerance=6):
    """Checks that every corner has the photo's colour at its position."""
    for positions, triangles, uvs, material, *_ in writer.meshes:
        for corner, uv in list(zip(positions[triangles].reshape(-1, 3), uvs.reshape(-1, 2), strict=True))[::17]:
            expected = colour_at(corner[0], corner[1])
            if expected is not None:
                np.testing.assert_allclose(sample(folder, writer.materials[material], uv), expected, atol=tolerance)


@pytest.mark.parametrize("texture_px", [128, 2048])
def test_the_photo_is_georeferenced_correctly(tmp_path, folder, texture_px):
    photo = colours(300, 400)
    dem, ortho = write(tmp_path / "dem.tif", hills(30, 40), 2.0), write(tmp_path / "ortho.tif", photo, 0.2)
    writer, _ = run(dem, ortho, folder, texture_px=texture_px)

    def colour_at(x, y):
        column, row = (x - WEST) / 0.2, (NORTH - y) / 0.2
        return photo[:, min(int(row), 299), min(int(column), 399)] if 1 < column < 399 and 1 < row < 299 else None

    check_colours(writer, folder, colour_at)
    for path in (folder / "textures").iterdir():
        assert path.stem == sha256(path.read_bytes()).hexdigest()[:32]
        assert path.suffix == ".jpg"
    assert max(sides(folder)) <= texture_px
    assert {material["texture"] for material in writer.materials} == {path.stem for path in (folder / "textures").iterdir()}
    assert {material["wrap"] for material in writer.materials} == {"clamp"}


def test_texture_tiles_overlap_so_that_no_seam_shows(tmp_path, folder):
    dem, ortho = write(tmp_path / "dem.tif", hills(40, 40), 1.0), write(tmp_path / "ortho.tif", colours(400, 400), 0.1)
    writer, _ = run(dem, ortho, folder, tile_cells=16)
    for _, _, uvs, material, *_ in writer.meshes:
        size = pixels(folder / "textures" / f"{writer.materials[material]['texture']}.jpg").shape[1::-1]
        texels = uvs.reshape(-1, 2) * size
        assert (texels >= 7.9).all()
        assert (texels <= np.array(size) - 7.9).all()


def test_a_photo_in_another_crs_is_draped_correctly(tmp_path, folder):
    photo = colours(200, 200)
    to_lonlat = Transformer.from_crs(25832, 4326, always_xy=True)
    west, south = to_lonlat.transform(WEST - 20, NORTH - 120)
    east, north = to_lonlat.transform(WEST + 120, NORTH + 20)
    place = from_bounds(west, south, east, north, 200, 200)
    ortho = write(tmp_path / "ortho.tif", photo, crs="EPSG:4326", transform=place)
    writer, _ = run(write(tmp_path / "dem.tif", hills(50, 50), 2.0), ortho, folder)

    def colour_at(x, y):
        column, row = pixel_of(place, *to_lonlat.transform(x, y))
        return photo[:, row, column]

    check_colours(writer, folder, colour_at)


def test_a_dem_in_degrees_is_transformed_to_the_scenes_crs(tmp_path, folder):
    west, south, east, north = 11.5, 48.1, 11.51, 48.105
    place = from_bounds(west, south, east, north, 20, 10)
    dem = write(tmp_path / "dem.tif", hills(10, 20), crs="EPSG:4326", transform=place)
    writer, report = run(dem, None, folder)
    to_utm = Transformer.from_crs(4326, 25832, always_xy=True)
    x, y = to_utm.transform(west + 0.5 * place.a, north + 0.5 * place.e)
    found = np.concatenate([positions for positions, *_ in writer.meshes])
    nearest = found[np.argmin(np.hypot(found[:, 0] - x, found[:, 1] - y))]
    np.testing.assert_allclose(nearest[:2], [x, y], atol=1e-6)
    assert nearest[2] == hills(10, 20)[0, 0, 0]
    assert report["projection"]["heights"] == "unchanged"
    assert up_triangles(writer).all()


@pytest.mark.parametrize("transform", [Affine(1, 0, WEST, 0, 1, NORTH), Affine(0, 1, WEST, 1, 0, NORTH), Affine(0.8, 0.6, WEST, 0.6, -0.8, NORTH)])
def test_rotated_and_mirrored_rasters_face_up(tmp_path, folder, transform):
    dem, ortho = (write(tmp_path / name, data, transform=transform) for name, data in (("dem.tif", hills(12, 17)), ("ortho.tif", colours(12, 17))))
    writer, _ = run(dem, ortho, folder)
    assert up_triangles(writer).all()

    def colour_at(x, y):
        column, row = pixel_of(transform, x, y)
        return colours(12, 17)[:, row, column] if 0 < column < 16 and 0 < row < 11 else None

    check_colours(writer, folder, colour_at, tolerance=25)


@pytest.mark.parametrize("gap", ["nodata", "nan", "implausible", "mask"])
def test_gaps_in_the_dem_are_gaps_in_the_terrain(tmp_path, folder, gap):
    data = hills(30, 30)
    hole = np.zeros((30, 30), dtype=bool)
    hole[10:15, 5:20] = True
    data[0, hole] = {"nodata": -9999, "nan": np.nan, "implausible": 1e30, "mask": 0}[gap]
    dem = write(tmp_path / "dem.tif", data, nodata=-9999 if gap == "nodata" else None)
    if gap == "mask":
        with rasterio.open(dem, "r+") as raster:
            raster.write_mask(~hole)
    writer, report = run(dem, None, folder)
    points = np.concatenate([positions for positions, *_ in writer.meshes])
    columns, rows = (points[:, 0] - WEST).astype(int), (NORTH - points[:, 1]).astype(int)
    assert not hole[np.clip(rows, 0, 29), np.clip(columns, 0, 29)].any()
    assert len(points) == 32 * 32 - 75
    assert skipped(report) == {"grid-points-without-height": 75}
    assert bool(warned(report)) == (gap == "implausible")


def test_a_raster_of_gaps_has_no_object(tmp_path, folder):
    writer, report = run(write(tmp_path / "dem.tif", np.full((1, 8, 8), -1, np.int16), nodata=-1), None, folder)
    assert (writer.meshes, writer.objects, writer.materials) == ([], [], [])
    assert report["triangles"] == 0


def test_a_raster_of_one_pixel_is_terrain(tmp_path, folder):
    writer, _ = run(write(tmp_path / "dem.tif", np.full((1, 1, 1), 7, np.float32), 10.0), None, folder)
    assert writer.triangle_count == 8
    assert np.unique(writer.soup()[..., 2]).tolist() == [7.0]


def test_terrain_outside_the_photo_has_the_ground_colour(tmp_path, folder):
    photo = np.full((3, 100, 50), 200, np.uint8)
    dem, ortho = write(tmp_path / "dem.tif", hills(50, 50), 2.0), write(tmp_path / "ortho.tif", photo, 1.0)
    writer, report = run(dem, ortho, folder, tile_cells=16, ground=(10, 20, 30))
    plain = next(number for number, material in enumerate(writer.materials) if material["texture"] is None)
    beyond = [mesh for mesh in writer.meshes if mesh[3] == plain]
    assert all((mesh[0][:, 0] > WEST + 50).all() for mesh in beyond)
    assert len(beyond) == warned(report)[0]["count"] > 0
    check_colours(writer_without(writer, plain), folder, lambda x, y: (200,) * 3 if x < WEST + 50 else (10, 20, 30) if x > WEST + 75 else None)


def writer_without(writer, material):
    writer.meshes = [mesh for mesh in writer.meshes if mesh[3] != material]
    return writer


def test_a_photo_without_dem_is_flat_and_transparent_in_gaps(tmp_path, folder):
    photo = colours(100, 100)
    photo[:, :50, :50] = 0
    writer, report = run(None, write(tmp_path / "ortho.tif", photo, nodata=0), folder, height_m=12.5)
    assert np.unique(writer.soup()[..., 2]).tolist() == [12.5]
    assert [material["cutout"] for material in writer.materials] == [True]
    image = pixels(next((folder / "textures").glob("*.png")))
    assert image.shape[2] == 4
    uv = {tuple(corner[:2]): uv for mesh in writer.meshes for corner, uv in zip(mesh[0][mesh[1]].reshape(-1, 3), mesh[2].reshape(-1, 2), strict=True)}
    u, v = uv[(WEST, NORTH)]
    assert image[int((1 - v) * image.shape[0]) + 10, int(u * image.shape[1]) + 10, 3] == 0
    u, v = uv[(WEST + 100, NORTH - 100)]
    assert image[int((1 - v) * image.shape[0]) - 10, int(u * image.shape[1]) - 10, 3] == 255
    assert report["objects"] == 1


def test_a_large_flat_photo_is_cut_into_tiles(tmp_path, folder):
    photo = colours(500, 300)
    writer, _ = run(None, write(tmp_path / "ortho.tif", photo, 0.5), folder, texture_px=256)
    assert len(writer.objects) == 3 * 2
    assert max(sides(folder)) <= 256
    check_colours(writer, folder, lambda x, y: photo[:, min(int((NORTH - y) / 0.5), 499), min(int((x - WEST) / 0.5), 299)])


def test_cells_wider_than_a_texture_are_parted(tmp_path, folder):
    dem = write(tmp_path / "dem.tif", hills(3, 3), 100.0)
    photo = colours(1500, 1500)
    writer, _ = run(dem, write(tmp_path / "ortho.tif", photo, 0.2), folder, texture_px=256)
    assert max(sides(folder)) <= 256
    points = {(x, y): z for positions, *_ in writer.meshes for x, y, z in positions.tolist()}
    assert points[(WEST + 150, NORTH - 150)] == float(hills(3, 3)[0, 1, 1])
    check_colours(writer, folder, lambda x, y: photo[:, min(int((NORTH - y) / 0.2), 1499), min(int((x - WEST) / 0.2), 1499)])


RGB = colours(40, 40)
LAYOUTS = {
    "rgb": (RGB, {}, RGB),
    "rgba": (np.concatenate([RGB, np.full((1, 40, 40), 255, np.uint8)]), {"photometric": "RGB", "alpha": "unassociated"}, RGB),
    "near infrared first": (
        np.concatenate([RGB[2:] * 0, RGB]),
        {"photometric": "MINISBLACK", "colorinterp": [ColorInterp.undefined, ColorInterp.red, ColorInterp.green, ColorInterp.blue]},
        RGB,
    ),
    "four bands of no stated meaning": (np.concatenate([RGB, RGB[:1]]), {"photometric": "MINISBLACK"}, RGB),
    "grey": (RGB[:1], {}, np.repeat(RGB[:1], 3, axis=0)),
    "float bytes": (RGB.astype(np.float32), {"nodata": NAN_LAYER}, RGB),
    "float shares": ((RGB / 255).astype(np.float32), {}, RGB),
    "uint16": (RGB.astype(np.uint16) * 257, {}, RGB),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_photos_of_any_reasonable_layout(tmp_path, folder, layout):
    data, profile, expected = LAYOUTS[layout]
    writer, _ = run(write(tmp_path / "dem.tif", hills(40, 40)), write(tmp_path / "ortho.tif", data, **profile), folder)
    check_colours(writer, folder, lambda x, y: expected[:, min(int(NORTH - y), 39), min(int(x - WEST), 39)], tolerance=24)


def test_a_palette_is_looked_up(tmp_path, folder):
    data = (np.indices((64, 64)).sum(axis=0) // 16 % 2).astype(np.uint8)[None]
    path = write(tmp_path / "ortho.tif", data, photometric="palette")
    with rasterio.open(path, "r+") as raster:
        raster.write_colormap(1, {0: (250, 10, 10, 255), 1: (10, 10, 250, 255)})
    run(None, path, folder)
    image = pixels(next((folder / "textures").iterdir()))[8:72, 8:72]
    expected = np.where(data[0, ..., None] == 0, (250, 10, 10), (10, 10, 250))
    inner = np.abs(np.indices((64, 64)).sum(axis=0) % 16 - 7.5) < 4
    np.testing.assert_allclose(image[inner], expected[inner], atol=40)


@pytest.mark.parametrize(("unit", "metres"), [("ft", 0.3048), ("US survey foot", 1200 / 3937), ("m", 1.0), (None, 1.0)])
def test_heights_are_converted_to_metres(tmp_path, folder, unit, metres):
    writer, report = run(write(tmp_path / "dem.tif", np.full((1, 4, 4), 100, np.float32), units=unit and [unit]), None, folder)
    assert np.unique(writer.soup()[..., 2]) == pytest.approx([100 * metres])
    assert warned(report) == []


def test_an_unknown_unit_is_a_warning(tmp_path, folder):
    _, report = run(write(tmp_path / "dem.tif", hills(4, 4), units=["furlong"]), None, folder)
    assert warned(report)[0]["example"] == "furlong"


def test_scaled_integers_are_heights(tmp_path, folder):
    writer, _ = run(write(tmp_path / "dem.tif", np.full((1, 4, 4), 1234, np.int16), scales=[0.1]), None, folder)
    assert np.unique(writer.soup()[..., 2]) == pytest.approx([123.4])


def test_a_raster_without_crs_is_assumed_in_the_scenes_with_a_warning(tmp_path, folder):
    writer, report = run(write(tmp_path / "dem.tif", hills(4, 4), crs=None), None, folder)
    assert writer.soup()[..., 0].min() == WEST
    assert warned(report)[0]["code"] == "raster-crs-assumed"
    assert report["crs"] is None


@pytest.mark.parametrize("own", [None, "EPSG:25833"])
def test_the_stated_crs_replaces_that_of_both_rasters(tmp_path, folder, own):
    def rasters(name, crs):
        (tmp_path / name).mkdir()
        return write(tmp_path / name / "dem.tif", hills(4, 4), crs=crs), write(tmp_path / name / "ortho.tif", colours(8, 8), 0.5, crs=crs)

    expected, _ = run(*rasters("right", "EPSG:25832"), folder, CRS.from_epsg(25831))
    got, report = run(*rasters("wrong", own), tmp_path / "stated", CRS.from_epsg(25831), crs="EPSG:25832")
    assert np.array_equal(got.soup(), expected.soup())
    assert np.abs(got.soup()[..., 0] - WEST).min() > 100_000, "the coordinates are transformed"
    assert warned(report) == []
    assert CRS.from_wkt(report["crs"]).to_epsg() == 25832


def test_a_local_scene_refuses_degrees(tmp_path, folder):
    dem = write(tmp_path / "dem.tif", hills(4, 4), crs="EPSG:4326", transform=from_bounds(11, 48, 12, 49, 4, 4))
    with pytest.raises(CrsError, match="--crs"):
        run(dem, None, folder, scene_crs=None)


def test_a_local_scene_accepts_metres(tmp_path, folder):
    writer, _ = run(write(tmp_path / "dem.tif", hills(4, 4)), None, folder, scene_crs=None)
    assert writer.soup()[..., 1].max() == NORTH


def test_equal_rasters_give_equal_assets(tmp_path):
    dem, ortho = write(tmp_path / "dem.tif", hills(50, 50), 2.0), write(tmp_path / "ortho.tif", colours(200, 200), 0.5)
    (one, first), (two, second) = (run(dem, ortho, tmp_path / name, tile_cells=16, max_error_m=0.3) for name in ("a", "b"))
    assert first == second
    assert one.materials == two.materials
    for mesh, other in zip(one.meshes, two.meshes, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(mesh[:3], other[:3], strict=True))


def test_nothing_to_import_is_refused(folder):
    with pytest.raises(BadRequest):
        import_terrain(None, None, folder, UTM)


def test_an_absent_raster_is_not_found(tmp_path, folder):
    with pytest.raises(NotFound):
        run(tmp_path / "none.tif", None, folder)


@pytest.mark.parametrize("data", [b"", b"II*\0garbage", b"<VRTDataset/>", b"\x89PNG\r\n\x1a\n"])
def test_invalid_rasters_are_refused(tmp_path, folder, data):
    (tmp_path / "dem.tif").write_bytes(data)
    with pytest.raises(ImportFailed):
        run(tmp_path / "dem.tif", None, folder)


def test_a_raster_without_georeference_is_refused(tmp_path, folder):
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / "ortho.png")
    with pytest.raises(ImportFailed, match="georeference"):
        run(None, tmp_path / "ortho.png", folder)


def test_a_world_file_georeferences_a_photo(tmp_path, folder):
    Image.fromarray(np.moveaxis(colours(30, 40), 0, -1)).save(tmp_path / "ortho.png")
    (tmp_path / "ortho.pgw").write_text(f"0.5\n0\n0\n-0.5\n{WEST + 0.25}\n{NORTH - 0.25}\n")
    writer, _ = run(None, tmp_path / "ortho.png", folder)
    assert writer.soup()[..., 0].max() == WEST + 20
    check_colours(writer, folder, lambda x, y: colours(30, 40)[:, min(int((NORTH - y) * 2), 29), min(int((x - WEST) * 2), 39)])


def test_a_virtual_raster_is_refused(tmp_path, folder):
    source = write(tmp_path / "dem.tif", hills(4, 4))
    virtual = tmp_path / "dem.vrt"
    copy(source, virtual, driver="VRT")
    with pytest.raises(ImportFailed):
        run(virtual, None, folder)


def test_what_can_be_read_of_a_truncated_raster_is_used_and_strict_reading_raises_its_name(tmp_path, folder):
    dem = write(tmp_path / "dem.tif", np.random.default_rng(0).random((1, 300, 300), np.float32))
    os.truncate(dem, dem.stat().st_size // 2)
    writer, report = run(dem, None, folder)
    assert finding("raster-damaged", 1, "dem.tif") in warned(report)
    assert writer.triangle_count == pytest.approx(2 * 301 * 301 / 2, rel=0.1)
    with pytest.raises(ImportFailed, match=r"dem\.tif: cannot read .* the file may be damaged"):
        run(dem, None, folder, strict=True)


def test_too_many_triangles_are_refused_with_advice(tmp_path, folder, monkeypatch):
    dem = write(tmp_path / "dem.tif", hills(20, 20))
    triangles = 2 * 21 * 21
    for limit in (triangles, triangles + 1):
        monkeypatch.setattr(terrain_rasters, "MAX_TRIANGLES", limit)
        run(dem, None, folder)
    monkeypatch.setattr(terrain_rasters, "MAX_TRIANGLES", triangles - 1)
    with pytest.raises(LimitExceeded, match=r"--max-error 0\.1, or reduce the resolution with gdal_translate"):
        run(dem, None, folder)
    run(dem, None, folder, max_error_m=0.5)


def test_the_user_can_stop_the_import(tmp_path, folder):
    seen = []
    dem = write(tmp_path / "dem.tif", hills(40, 40))
    with pytest.raises(Stopped):
        import_terrain(dem, None, folder, UTM, TerrainOptions(tile_cells=8), lambda *step: seen.append(step) or len(seen) < 3, RecordingWriter())
    assert seen == [("terrain", done, 36) for done in range(3)]


@pytest.mark.parametrize(
    "options", [{"max_error_m": -1.0}, {"max_error_m": np.nan}, {"tile_cells": 100}, {"tile_cells": 0}, {"texture_px": 8}, {"height_m": np.inf}]
)
def test_invalid_options_are_refused(options):
    with pytest.raises(BadRequest):
        TerrainOptions(**options)


DATA = os.environ.get("MAP3D_DATA")
REAL = {
    "lyon": ("raster-lyon-dem-oslandia/dem.tif", "raster-lyon-dem-oslandia/N02.tif", 3946),
    "field": ("raster-odm-fieldimager/dsm.tif", "raster-odm-fieldimager/odm_orthophoto.tif", 32616),
    "naip": (None, "raster-naip-nd/naip/m_4709963_se_14_1_20190904.tif", 26914),
}


@pytest.mark.skipif(not DATA, reason="MAP3D_DATA does not name the folder of real rasters")
@pytest.mark.parametrize("place", REAL)
def test_real_rasters(folder, place):
    dem, ortho, epsg = REAL[place]
    writer, report = run(dem and Path(DATA, dem), Path(DATA, ortho), folder, scene_crs=CRS.from_epsg(epsg), max_error_m=0.2)
    assert report["triangles"] > 0
    assert up_triangles(writer).all()
    assert any(material["texture"] for material in writer.materials)
