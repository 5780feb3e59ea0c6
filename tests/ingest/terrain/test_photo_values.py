"""Photos of more than 8 bits, margins without a picture, and photos and elevation models that are damaged."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from PIL import Image
from pyproj import CRS

from map3d.ingest.findings import finding
from map3d.ingest.terrain.parse_terrain import open_terrain_parser
from map3d.ingest.terrain.photo_margin import find_margin
from map3d.ingest.terrain.photo_values import find_range
from map3d.ingest.terrain.terrain_import import import_terrain
from map3d.ingest.terrain.terrain_options import TerrainOptions
from tests.findings import warned
from tests.ingest.terrain.rasters import NORTH, WEST, RecordingWriter, colours, hills, write

UTM = CRS.from_epsg(25832)
PHOTO = np.random.default_rng(7).integers(0, 256, (3, 40, 40), dtype=np.uint8)


def imported(folder: Path, *photos: Path, **options: Any) -> tuple[np.ndarray, dict[str, Any]]:
    """Returns the pixels of the only texture, as (h, w, bands), and the report of an import of photos alone."""
    report = import_terrain([], list(photos), folder, UTM, TerrainOptions(**options), writer=RecordingWriter())
    (texture,) = (folder / "textures").iterdir()
    with Image.open(texture) as image:
        return np.asarray(image.convert("RGBA" if texture.suffix == ".png" else "RGB")), report


@pytest.mark.parametrize(
    ("values", "bits", "range_", "words"),
    [
        (PHOTO.astype(float), 0, (0, 255), ""),
        (PHOTO / 255.0, 0, (0, 1), "shares"),
        (PHOTO * 257.0, 0, (0, 65_535), "16 bits"),
        (PHOTO[PHOTO < 40] * 257.0, 0, (0, 65_535), "16 bits"),
        (PHOTO * 130.0, 0, (0, 65_535), "16 bits"),
        (PHOTO * 4.0, 0, (0, 1_023), "10 bits"),
        (PHOTO * 8.0, 0, (0, 2_047), "11 bits"),
        (PHOTO * 16.0, 0, (0, 4_095), "12 bits"),
        (PHOTO * 4.0, 12, (0, 4_095), "12 bits, as the file says"),
        (PHOTO * 30.0, 0, None, "percentile"),
        (PHOTO * 16.0 - 5.0, 0, None, "percentile"),
    ],
)
def test_one_rule_says_which_values_are_black_and_white(values: np.ndarray, bits: int, range_: tuple[int, int] | None, words: str) -> None:
    found = find_range(np.asarray(values).ravel(), bits=bits)
    assert words in found.words
    if range_ is not None:
        assert found.stretch == range_
    else:
        assert found.stretch == tuple(np.percentile(values, [0.5, 99.5]))


def test_numbers_with_fractions_are_stretched() -> None:
    assert "percentile" in find_range(PHOTO.ravel() * 257.0, whole_numbers=False).words


def test_a_photo_of_16_bits_is_that_of_bytes_and_said(tmp_path: Path) -> None:
    wide, said = imported(tmp_path / "a", write(tmp_path / "wide.tif", PHOTO.astype(np.uint16) * 257))
    narrow, silent = imported(tmp_path / "b", write(tmp_path / "narrow.tif", PHOTO))
    assert np.array_equal(wide, narrow)
    assert (warned(silent), [item["code"] for item in warned(said)]) == ([], ["photo-values-scaled"])
    assert warned(said)[0]["example"] == "wide.tif: 0 to 65,535 are shown as black to white: 16 bits by the greatest value"


def with_margin(colour: int, side: int = 60, width: int = 12) -> np.ndarray:
    """Returns a photo that is turned by 45 degrees, with corners of one colour."""
    data = np.clip(np.random.default_rng(3).integers(40, 200, (3, side, side)), 1, 254).astype(np.uint8)
    y, x = np.mgrid[0:side, 0:side]
    far = np.abs(x - (side - 1) / 2) + np.abs(y - (side - 1) / 2) > side / 2 - 2
    data[:, far] = colour
    return data


@pytest.mark.parametrize(("colour", "name"), [(0, "black"), (255, "white")])
@pytest.mark.parametrize("compress", ["deflate", "jpeg"])
def test_margins_of_photos_without_gaps_are_transparent(tmp_path: Path, colour: int, name: str, compress: str) -> None:
    data = with_margin(colour)
    path = write(tmp_path / "turned.tif", data, compress=compress, **({"photometric": "ycbcr"} if compress == "jpeg" else {}))
    image, report = imported(tmp_path / "asset", path)
    assert warned(report) == [finding("photo-margin-transparent", 1, f"turned.tif: {name}")]
    alpha = image[8:68, 8:68, 3]
    inside = (data != colour).any(axis=0)
    edge = np.zeros_like(inside)
    edge[1:] |= inside[1:] != inside[:-1]
    edge[:-1] |= inside[1:] != inside[:-1]
    edge[:, 1:] |= inside[:, 1:] != inside[:, :-1]
    edge[:, :-1] |= inside[:, 1:] != inside[:, :-1]
    clear = ~edge if compress == "jpeg" else np.ones_like(edge)
    assert np.mean((alpha > 0)[clear] == inside[clear]) > (0.97 if compress == "jpeg" else 0.9999)


def test_a_black_frame_of_one_pixel_is_a_margin(tmp_path: Path) -> None:
    data = PHOTO | 16
    data[:, [0, -1]] = 0
    data[:, :, [0, -1]] = 0
    image, _ = imported(tmp_path / "asset", write(tmp_path / "framed.tif", data))
    assert (image[8:48, 8:48, 3] == 0).sum() == 4 * 39


PLAIN = {
    "a black roof at the edge": lambda data: data.__setitem__((slice(None), slice(0, 5), slice(10, 15)), 0),
    "black pixels inside": lambda data: data.__setitem__((slice(None), slice(10, 30), slice(10, 30)), 0),
    "a small black corner": lambda data: data.__setitem__((slice(None), slice(0, 4), slice(0, 4)), 0),
    "all black": lambda data: data.__setitem__(slice(None), 0),
}


@pytest.mark.parametrize("name", PLAIN)
def test_other_black_pixels_stay(tmp_path: Path, name: str) -> None:
    data = PHOTO | 16
    PLAIN[name](data)
    with rasterio.open(write(tmp_path / "a.tif", data)) as raster:
        assert find_margin(raster, raster) is None


def test_a_photo_with_declared_gaps_keeps_its_black(tmp_path: Path) -> None:
    with rasterio.open(write(tmp_path / "a.tif", with_margin(0), nodata=255)) as raster:
        assert find_margin(raster, raster) is None


def test_the_photo_below_is_seen_through_a_margin(tmp_path: Path) -> None:
    above = write(tmp_path / "a_2023.tif", with_margin(255))
    below = write(tmp_path / "b_2019.tif", np.full((3, 60, 60), 77, np.uint8))
    image, report = imported(tmp_path / "asset", above, below)
    assert image.shape[2] == 3
    assert np.abs(image[10, 10].astype(int) - 77).max() < 12
    assert {item["code"]: item["example"] for item in warned(report)} == {
        "raster-under-others": "b_2019.tif under a_2023.tif, which is newer",
        "photo-margin-transparent": "a_2023.tif: white",
    }


def cut(path: Path, share: float = 0.66) -> Path:
    os.truncate(path, int(path.stat().st_size * share))
    return path


def tile(folder: Path, name: str, data: np.ndarray, column: int, **options: Any) -> Path:
    folder.mkdir(exist_ok=True)
    return write(folder / f"{name}_{column}.tif", data, transform=Affine(1, 0, WEST + 40 * column, 0, -1, NORTH), **options)


def parse(folder: Path, *paths: Path, strict: bool = False, **more: Any) -> dict[str, Any]:
    """Returns the report of the process that parses rasters, run in this one."""
    folder.mkdir()
    request = {
        "paths": [str(path) for path in paths], "folder": str(folder), "name": "t", "crs": None, "scene_crs": None, "scene_origin": None,
        "reader": {"strict": strict}, "checkpoints": None, "cores": 2, "grids": {}, "virtual": {}, "ground": None, **more,
    }  # fmt: skip
    answer, _ = open_terrain_parser({})(request, [], lambda _: None)
    report: dict[str, Any] = answer["report"]
    return report


def said(report: dict[str, Any]) -> dict[str, str]:
    return {item["code"]: item["example"] for item in warned(report)}


@pytest.mark.parametrize("broken", ["dem", "photo"])
def test_a_raster_that_is_cut_costs_itself(tmp_path: Path, broken: str) -> None:
    noise = np.random.default_rng(5)
    dems = [tile(tmp_path / "d", "dem", noise.random((1, 40, 40), np.float32), k, blockysize=4) for k in range(3)]
    photos = [tile(tmp_path / "d", "photo", colours(40, 40), k, blockysize=4) for k in range(3)]
    cut({"dem": dems, "photo": photos}[broken][1])
    report = parse(tmp_path / "asset", *dems, *photos)
    assert report["rasters"] == {"elevation": 3, "imagery": 3}
    assert said(report)["raster-damaged"] == f"{broken}_1.tif"
    full = 2 * 41 * 121
    assert report["triangles"] == pytest.approx(full if broken == "photo" else full * (1 - 0.34 / 3), rel=0.05)
    with pytest.raises(Exception, match=rf"{broken}_1\.tif: cannot read"):
        parse(tmp_path / "strict", *dems, *photos, strict=True)


def test_an_elevation_model_without_any_height_leaves_the_photo(tmp_path: Path) -> None:
    dem = write(tmp_path / "dem.tif", np.full((1, 40, 40), -9999, np.float32), nodata=-9999)
    report = parse(tmp_path / "asset", dem, write(tmp_path / "photo.tif", colours(40, 40)))
    assert report["rasters"] == {"elevation": 0, "imagery": 1}
    assert said(report) == {"elevation-without-heights": "dem.tif"}
    assert (report["triangles"] > 0, report["first_raster"]) == (True, "photo.tif")


def test_a_raster_that_cannot_lie_in_the_scene_costs_itself(tmp_path: Path) -> None:
    near = write(tmp_path / "near.tif", hills(40, 40))
    nowhere = write(tmp_path / "nowhere.tif", hills(40, 40), crs=None, transform=Affine(1, 0, 0, 0, -1, 100))
    scene = {"scene_crs": UTM.to_wkt(), "scene_origin": [WEST, NORTH, 0.0]}
    report = parse(tmp_path / "asset", near, nowhere, **scene)
    assert report["rasters"] == {"elevation": 1, "imagery": 0}
    assert "nowhere.tif: without a CRS of its own" in said(report)["raster-misplaced"]


def test_a_wide_photo_that_is_cut_still_has_a_range(tmp_path: Path) -> None:
    path = write(tmp_path / "wide.tif", hills(400, 400).astype(np.uint16).repeat(3, axis=0) * 900 + 900, blockysize=8)
    report = parse(tmp_path / "asset", cut(path, 0.5), write(tmp_path / "dem.tif", hills(400, 400)))
    assert {"raster-damaged", "photo-values-scaled"} <= set(said(report))
