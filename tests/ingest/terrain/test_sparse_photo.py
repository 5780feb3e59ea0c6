"""Photos far larger than memory: sparse GeoTIFFs, areas without data and of one colour."""

from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from PIL import Image
from pyproj import CRS
from rasterio.windows import Window

pytest.importorskip("map3d._core", reason="the compiled core is not built")

from map3d.errors import LimitExceeded
from map3d.ingest.terrain import terrain_rasters
from map3d.ingest.terrain.orthophoto import Orthophoto
from map3d.ingest.terrain.terrain_import import import_terrain
from map3d.ingest.terrain.terrain_options import TerrainOptions
from tests.findings import warned
from tests.ingest.terrain.rasters import NORTH, WEST, RecordingWriter, colours, hills, write

UTM = CRS.from_epsg(25832)
BLOCK, PIXEL_M = 512, 0.1
WIDTH, HEIGHT = 62_000, 24_869
"""A tenth of the size of a photo of a whole canton."""

Place = tuple[int, int]


def write_sparse(
    path: Path, width: int, height: int, filled: list[Place], pixel_m: float = PIXEL_M, interleave: str = "pixel", dtype: str = "uint8"
) -> Path:
    """Writes a photo of which only some blocks, given as (column, row), are stored. Values are those of bytes, times 16 in other types."""
    shape = {"width": width, "height": height, "count": 3, "dtype": dtype, "tiled": True, "blockxsize": BLOCK, "blockysize": BLOCK}
    place = {"crs": "EPSG:25832", "transform": Affine(pixel_m, 0, WEST, 0, -pixel_m, NORTH)}
    layout = {"compress": "deflate", "BIGTIFF": "YES", "SPARSE_OK": True, "photometric": "RGB", "interleave": interleave}
    with rasterio.open(path, "w", driver="GTiff", **shape, **place, **layout) as photo:
        for column, row in filled:
            values = colours(BLOCK, BLOCK).astype(dtype) * (1 if dtype == "uint8" else 16)
            photo.write(values, window=Window(column * BLOCK, row * BLOCK, BLOCK, BLOCK))
    return path


def run(dem: Path | None, ortho: Path, folder: Path, **options: object) -> tuple[RecordingWriter, dict[str, object]]:
    writer = RecordingWriter()
    return writer, import_terrain(dem, ortho, folder, UTM, TerrainOptions(**options), writer=writer)  # type: ignore[arg-type]


def pixels(path: Path) -> np.ndarray:  # type: ignore[type-arg]
    with Image.open(path) as image:
        return np.asarray(image)


def images(folder: Path) -> list[Path]:
    return sorted((folder / "textures").iterdir())


@pytest.mark.parametrize("with_dem", [True, False])
def test_a_huge_sparse_photo_has_images_only_where_it_has_blocks(tmp_path: Path, with_dem: bool) -> None:
    filled = [(3, 2), (60, 30), (100, 40)]
    ortho = write_sparse(tmp_path / "ortho.tif", WIDTH, HEIGHT, filled)
    dem = write(tmp_path / "dem.tif", hills(101, 249), 25.0) if with_dem else None
    writer, report = run(dem, ortho, tmp_path / "asset", workers=2)
    assert 3 <= len(images(tmp_path / "asset")) <= 4 * len(filled)
    assert len(writer.materials) == len(images(tmp_path / "asset")) + with_dem
    tiles = len(writer.objects)
    assert tiles == (32 * 13 if with_dem else len(images(tmp_path / "asset")))
    outside = [warning["count"] for warning in warned(report) if warning["code"] == "tiles-outside-photo"]  # type: ignore[attr-defined]
    assert outside == ([tiles - len(images(tmp_path / "asset"))] if with_dem else [])


@pytest.mark.parametrize("with_dem", [True, False])
def test_too_many_tiles_are_refused_with_advice(tmp_path: Path, with_dem: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    ortho = write_sparse(tmp_path / "ortho.tif", WIDTH, HEIGHT, [(3, 2)])
    dem = write(tmp_path / "dem.tif", hills(101, 249), 25.0) if with_dem else None
    tiles = 32 * 13 if with_dem else 31 * 13
    monkeypatch.setattr(terrain_rasters, "MAX_TILES", tiles - 1)
    with pytest.raises(LimitExceeded, match=rf"{tiles} tiles of terrain, the limit is {tiles - 1}; reduce the resolution"):
        run(dem, ortho, tmp_path / "asset")


@pytest.mark.parametrize("interleave", ["pixel", "band"])
def test_pixels_of_absent_blocks_are_gaps(tmp_path: Path, interleave: str) -> None:
    path = write_sparse(tmp_path / "ortho.tif", 4 * BLOCK, 2 * BLOCK, [(1, 0), (2, 1)], interleave=interleave)
    with rasterio.open(path) as dataset:
        photo = Orthophoto(dataset, (10, 20, 30), 2048)
        for rows, columns in ((2 * BLOCK, 4 * BLOCK), (BLOCK, BLOCK), (7, 9)):
            _, covered = photo._read_inside(Window(0, 0, 4 * BLOCK, 2 * BLOCK), rows, columns)
            row, column = (np.arange(count) + 0.5 for count in (rows, columns))
            y, x = (row * 2 / rows).astype(int)[:, None], (column * 4 / columns).astype(int)[None, :]
            assert np.array_equal(covered, ((y == 0) & (x == 1)) | ((y == 1) & (x == 2)))


def test_a_photo_of_one_colour_has_one_small_image(tmp_path: Path) -> None:
    photo = np.broadcast_to(np.array([200, 90, 30], np.uint8)[:, None, None], (3, 1000, 1000))
    dem, ortho = write(tmp_path / "dem.tif", hills(100, 100), 5.0), write(tmp_path / "ortho.tif", photo, 0.5)
    writer, _ = run(dem, ortho, tmp_path / "asset", tile_cells=16, texture_px=256)
    inside = [material for material in writer.materials if material["texture"]]
    plain = [path for path in images(tmp_path / "asset") if pixels(path).shape == (8, 8, 3)]
    assert len(writer.objects) == 7 * 7
    assert len(plain) == 1
    assert len(inside) < 49
    np.testing.assert_allclose(pixels(plain[0]), np.broadcast_to([200, 90, 30], (8, 8, 3)), atol=3)
    uvs = np.concatenate([mesh[2] for mesh in writer.meshes if writer.materials[mesh[3]]["texture"] == plain[0].stem])
    assert uvs.min() >= 0
    assert uvs.max() <= 1


@pytest.mark.parametrize(("columns", "rows"), [(4, 4), (40, 20)])
def test_the_range_of_values_is_that_of_the_stored_blocks(tmp_path: Path, columns: int, rows: int) -> None:
    """Values of up to 16 times 255 fill twelve bits. A sample that misses the stored block would be black."""
    path = write_sparse(tmp_path / "ortho.tif", columns * BLOCK, rows * BLOCK, [(columns - 1, rows - 2)], dtype="uint16")
    with rasterio.open(path) as dataset:
        low, high = Orthophoto(dataset, (10, 20, 30), 2048).stretch
    assert (low, high) == (0.0, 4095.0)


@pytest.mark.parametrize("layout", [{"tiled": True, "blockxsize": 256, "blockysize": 256}, {"tiled": False, "blockysize": 1}])
def test_windows_of_a_large_photo_give_its_range_of_values(tmp_path: Path, layout: dict[str, object], monkeypatch: pytest.MonkeyPatch) -> None:
    ramp = np.broadcast_to(np.arange(3000, dtype=np.uint16), (3, 1000, 3000)).copy()
    with rasterio.open(write(tmp_path / "ortho.tif", ramp, 0.5, **layout)) as dataset:
        whole = Orthophoto(dataset, (10, 20, 30), 2048).stretch
        monkeypatch.setattr("map3d.ingest.terrain.photo_values.WHOLE_SAMPLE_PX", 1)
        windows = Orthophoto(dataset, (10, 20, 30), 2048).stretch
    np.testing.assert_allclose(windows, whole, atol=100)
