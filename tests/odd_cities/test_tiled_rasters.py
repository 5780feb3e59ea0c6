"""Elevation models and orthophotos in tiles, with gaps, of several resolutions and CRSs, in folders of their own."""

from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from PIL import Image
from pyproj import CRS, Transformer

from map3d.ingest.findings import finding
from map3d.ingest.sources import find_sources
from map3d.ingest.terrain.terrain_import import import_terrain
from map3d.ingest.terrain.terrain_options import TerrainOptions
from tests.cli.towns import Run
from tests.findings import skipped, warned
from tests.ingest.terrain.rasters import NORTH, WEST, RecordingWriter, colours, from_bounds, hills, write
from tests.odd_cities.test_axis_order import add
from tests.odd_cities.towns import world_boxes

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

UTM = CRS.from_epsg(25832)


def write_tiles(folder: Path, name: str, data: np.ndarray, side: int, pixel_m: float = 1.0, **options: object) -> list[Path]:
    """Writes squares of `side` pixels of a raster, row by row."""
    folder.mkdir(parents=True, exist_ok=True)
    return [
        write(
            folder / f"{name}-{top}-{left}.tif",
            data[:, top : top + side, left : left + side],
            transform=Affine(pixel_m, 0, WEST + left * pixel_m, 0, -pixel_m, NORTH - top * pixel_m),
            **options,
        )
        for top in range(0, data.shape[1], side)
        for left in range(0, data.shape[2], side)
    ]


def imported(folder: Path, dems: list[Path], photos: list[Path], **options: object) -> tuple[dict, RecordingWriter, list[str]]:
    """Returns the report, the meshes and the names of the textures, which are their hashes."""
    writer = RecordingWriter()
    report = import_terrain(dems, photos, folder, UTM, TerrainOptions(tile_cells=16, **options), writer=writer)  # type: ignore[arg-type]
    return report, writer, sorted(path.name for path in (folder / "textures").iterdir())


def heights_at(writer: RecordingWriter) -> dict[tuple[float, float], float]:
    return {(round(x, 3), round(y, 3)): z for positions, *_ in writer.meshes for x, y, z in positions}


def test_four_tiles_are_the_whole_bit_by_bit(tmp_path: Path) -> None:
    height, photo = hills(40, 60), colours(80, 120)
    whole = imported(tmp_path / "whole", [write(tmp_path / "dem.tif", height)], [write(tmp_path / "photo.tif", photo, pixel_m=0.5)])
    tiles = imported(tmp_path / "tiles", write_tiles(tmp_path / "dem", "dem", height, 25), write_tiles(tmp_path / "photo", "p", photo, 50, 0.5))
    assert tiles[0] == {**whole[0], "crs": tiles[0]["crs"]}
    assert tiles[2] == whole[2]
    for one, other in zip(whole[1].meshes, tiles[1].meshes, strict=True):
        for a, b in zip(one, other, strict=True):
            assert np.array_equal(a, b)


def test_a_missing_tile_is_a_gap(tmp_path: Path) -> None:
    dems = write_tiles(tmp_path / "dem", "dem", hills(40, 40), 20)
    photos = write_tiles(tmp_path / "photo", "photo", colours(40, 40), 20)
    report, writer, _ = imported(tmp_path / "a", dems[:3], photos)
    heights = heights_at(writer)
    assert heights[(WEST + 10.5, NORTH - 30.5)] == pytest.approx(float(hills(40, 40)[0, 30, 10]), abs=1e-6)
    assert not any(x > WEST + 21 and y < NORTH - 21 for x, y in heights)
    assert skipped(report)["grid-points-without-height"] > 0
    assert report["triangles"] == pytest.approx(2 * 41 * 41 * 0.75, rel=0.1)
    report, _, textures = imported(tmp_path / "b", dems, photos[1:])
    assert warned(report) in ([], [finding("tiles-outside-photo", 1, "dem-0-0.tif")])
    assert len(textures) >= 8


def test_rasters_that_lie_apart_cost_only_what_they_cover(tmp_path: Path) -> None:
    """Two tiles 3,000 km apart: a grid over both has 10^13 cells."""
    far = Affine(1, 0, WEST - 3_000_000, 0, -1, NORTH - 3_000_000)
    with pytest.raises(Exception, match="too far apart for one terrain; import them one by one"):
        imported(tmp_path / "a", [write(tmp_path / "a.tif", hills(20, 20)), write(tmp_path / "b.tif", hills(20, 20), transform=far)], [])
    near = Affine(1, 0, WEST - 3_000, 0, -1, NORTH - 3_000)
    report, _, _ = imported(tmp_path / "b", [tmp_path / "a.tif", write(tmp_path / "c.tif", hills(20, 20), transform=near)], [])
    assert report["triangles"] >= 2 * 2 * 19 * 19
    assert report["triangles"] <= 2 * 2 * 23 * 23


def test_images_with_world_files_and_ascii_grids_are_terrain(tmp_path: Path, run: Run) -> None:
    """What rasterio writes as an ASCII grid and JPEGs comes back as heights and colours, in the CRS that is given."""
    folder = tmp_path / "place"
    height = hills(20, 20)
    folder.mkdir()
    place = f"xllcorner {WEST}\nyllcorner {NORTH - 20}\ncellsize 1\n"
    rows = "\n".join(" ".join(f"{value:.3f}" for value in row) for row in height[0])
    (folder / "dem.asc").write_text(f"ncols 20\nnrows 20\n{place}{rows}\n")
    for name, column in (("west", 0), ("east", 10)):
        Image.fromarray(np.full((40, 20, 3), 40 + 10 * column, dtype=np.uint8)).save(folder / f"{name}.jpg")
        (folder / f"{name}.jgw").write_text(f"0.5\n0\n0\n-0.5\n{WEST + column + 0.25}\n{NORTH - 0.25}\n")
    Image.new("RGB", (4, 4)).save(folder / "logo.png")
    (source,) = find_sources([folder])
    assert [path.name for path in source.paths] == ["dem.asc", "east.jpg", "west.jpg"]
    workspace, done = add(tmp_path, folder, crs="EPSG:25832")
    assert done.report["rasters"] == {"elevation": 1, "imagery": 2}
    (box,) = {box for boxes in [world_boxes(workspace, "town")] for box in boxes.values()}
    assert np.allclose(box, [[WEST, NORTH - 20, height.min()], [WEST + 20, NORTH, height.max()]], atol=0.01)


def test_one_raster_far_from_the_others_is_left_out_and_named(tmp_path: Path) -> None:
    folder = tmp_path / "place"
    write_tiles(folder, "dem", hills(40, 40), 20)
    write(folder / "astray.tif", hills(20, 20), transform=Affine(1, 0, WEST - 3_000_000, 0, -1, NORTH))
    _, done = add(tmp_path, folder)
    (warning,) = [one for one in warned(done.report) if one["code"] == "raster-far-from-others"]
    assert (warning["count"], warning["example"].startswith("astray.tif lies 3,000 km from the other rasters")) == (1, True)
    assert done.report["rasters"] == {"elevation": 4, "imagery": 0}
    assert done.triangles == 2 * 41 * 41


def test_the_finer_raster_counts_where_resolutions_differ(tmp_path: Path) -> None:
    plane = np.full((1, 40, 40), 100.0, dtype=np.float32)
    coarse = write(tmp_path / "a.tif", plane, pixel_m=4.0)
    fine = write(tmp_path / "b.tif", plane + 50.0, transform=Affine(1, 0, WEST + 40, 0, -1, NORTH - 40))
    report, writer, _ = imported(tmp_path / "asset", [coarse, fine], [])
    heights = heights_at(writer)
    assert heights[(WEST + 60.5, NORTH - 60.5)] == 150.0
    assert heights[(WEST + 20.5, NORTH - 60.5)] == 100.0
    assert heights[(WEST + 100.5, NORTH - 100.5)] == 100.0
    (warning,) = warned(report)
    assert warning["code"] == "raster-resolutions-differ"
    assert warning["example"] == "a.tif: pixels of 1, 4; all are read with pixels of 1"


def test_rasters_of_two_crs_are_one_terrain(tmp_path: Path) -> None:
    """The eastern tile is in UTM zone 33; the slope continues, but for the outer half of its edge pixels, which are level."""
    to_33 = Transformer.from_crs(25832, 25833, always_xy=True)
    x, _ = np.meshgrid(WEST + np.arange(60) + 0.5, NORTH - np.arange(60) - 0.5)
    slope = ((x - WEST) * 0.1)[None].astype(np.float32)
    west = write(tmp_path / "west.tif", slope[:, :, :30])
    corners = np.array([to_33.transform(WEST + dx, NORTH + dy) for dx in (20, 62) for dy in (2, -62)])
    left, bottom, right, top = corners[:, 0].min(), corners[:, 1].min(), corners[:, 0].max(), corners[:, 1].max()
    columns, rows = int(right - left), int(top - bottom)
    place = from_bounds(left, bottom, left + columns, bottom + rows, columns, rows)
    back = Transformer.from_crs(25833, 25832, always_xy=True)
    east_x, _ = back.transform(*np.meshgrid(left + np.arange(columns) + 0.5, bottom + rows - np.arange(rows) - 0.5))
    east = write(tmp_path / "x-east.tif", ((east_x - WEST) * 0.1)[None].astype(np.float32), crs="EPSG:25833", transform=place)
    _, writer, _ = imported(tmp_path / "asset", [west, east], [])
    heights = heights_at(writer)
    inside = {(x, y): z for (x, y), z in heights.items() if WEST + 2 < x < WEST + 58 and NORTH - 58 < y < NORTH - 2}
    assert len(inside) > 56 * 56 * 0.95
    assert max(abs(z - (x - WEST) * 0.1) for (x, _), z in inside.items()) < 0.05


def test_photos_of_two_crs_leave_no_dark_edge(tmp_path: Path) -> None:
    """A white photo in UTM zone 32 under one in zone 33, whose corners lie inside it."""
    white = np.full((3, 80, 80), 255, dtype=np.uint8)
    west = write(tmp_path / "a.tif", white)
    x, y = Transformer.from_crs(25832, 25833, always_xy=True).transform(WEST + 40, NORTH - 40)
    place = from_bounds(x - 20, y - 20, x + 20, y + 20, 80, 80)
    east = write(tmp_path / "b.tif", white, crs="EPSG:25833", transform=place)
    _, _, textures = imported(tmp_path / "asset", [], [west, east])
    from PIL import Image

    with Image.open(tmp_path / "asset" / "textures" / textures[0]) as image:
        pixels = np.asarray(image.convert("L"))
    assert pixels[40:-40, 40:-40].min() >= 250


def test_photos_of_16_bits_share_one_range_of_values(tmp_path: Path) -> None:
    dark = np.full((3, 20, 20), 1000, dtype=np.uint16)
    bright = np.full((3, 20, 20), 3000, dtype=np.uint16)
    photos = write_tiles(tmp_path, "photo", np.concatenate([dark, bright], axis=2), 20)
    _, writer, textures = imported(tmp_path / "asset", [], photos)
    assert len(writer.meshes) == 1
    from PIL import Image

    with Image.open(tmp_path / "asset" / "textures" / textures[0]) as image:
        pixels = np.asarray(image.convert("L"))
    row = pixels[pixels.shape[0] // 2]
    assert row.min() < 20
    assert row.max() > 235


def test_palette_grey_and_colour_photos_mix(tmp_path: Path) -> None:
    grey = write(tmp_path / "a.tif", np.full((1, 20, 20), 200, dtype=np.uint8))
    colour = write(tmp_path / "b.tif", colours(20, 20), transform=Affine(1, 0, WEST + 20, 0, -1, NORTH))
    report, writer, textures = imported(tmp_path / "asset", [], [grey, colour])
    assert (len(writer.meshes), len(textures), warned(report)) == (1, 1, [])


def test_rasters_below_a_folder_are_one_source_and_given_ones_are_named_after_the_first(tmp_path: Path) -> None:
    dems = write_tiles(tmp_path / "city" / "dem", "dem", hills(20, 20), 10)
    photos = write_tiles(tmp_path / "city" / "photo", "photo", colours(20, 20), 10)
    (source,) = find_sources([tmp_path / "city"])
    assert (source.name, set(source.paths)) == ("city", {*dems, *photos})
    assert [source.name for source in find_sources([tmp_path / "city" / "dem"])] == ["dem"]
    assert [source.name for source in find_sources(dems[:2])] == ["dem-0-0"]
    assert [source.name for source in find_sources(dems[2:])] == ["dem-10-0"]


def test_tiles_added_one_after_another_are_all_there(tmp_path: Path) -> None:
    """Once, the second pair replaced the first, because both were named after their folder."""
    dems = write_tiles(tmp_path / "tiles", "dem", hills(20, 40), 20)
    photos = write_tiles(tmp_path / "tiles", "photo", colours(20, 40), 20)
    from map3d.catalogue import SceneRecord, Workspace
    from map3d.coherence.import_files import import_files
    from map3d.ingest.import_options import ImportOptions

    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    for pair in zip(dems, photos, strict=True):
        assert not import_files(workspace, catalogue, "town", pair, ImportOptions()).failed
    assert [asset.name for asset in catalogue.assets("town")] == ["dem-0-0", "dem-0-20"]
    catalogue.close()
    boxes = world_boxes(workspace, "town").values()
    assert (min(box[0][0] for box in boxes), max(box[1][0] for box in boxes)) == (WEST, WEST + 40)


def test_a_stated_crs_holds_for_every_tile(tmp_path: Path) -> None:
    write_tiles(tmp_path / "tiles", "dem", hills(20, 40), 20, crs=None)
    _, done = add(tmp_path, tmp_path / "tiles", crs="EPSG:25832")
    assert warned(done.report) == []
    assert done.report["placing"]["from"] == "ETRS89 / UTM zone 32N"


def test_site_makes_one_map_of_tiles_in_folders_of_their_own(tmp_path: Path, run: Run) -> None:
    write_tiles(tmp_path / "city" / "dem", "dem", hills(40, 40), 20, crs=None)
    (tmp_path / "city" / "dem" / "dem-20-20.tif").unlink()
    write_tiles(tmp_path / "city" / "photo", "photo", colours(80, 80), 40, 0.5, crs=None)
    status, out, err = run("site", "city", "-o", "site", "--crs", "EPSG:25832", "--res", "1", "--view", "0-90", "--workers", "1")
    assert status == 0, err
    assert "imported 1 file, 0 unchanged, 0 failed, 0 removed\n" in out
    assert "place: near Munich, Germany" in out
    assert (tmp_path / "site" / "index.html").is_file()
