"""Thumbnails of views, made of the coarsest tiles."""

import base64
from io import BytesIO

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from map3d import _core
from map3d.renderings.thumbnail import SIDE_PX, make_thumbnail
from map3d.tiles.light_colors import AMBIENT, DEFAULT_LIGHT, DIFFUSE
from map3d.tiles.manifest import Thumbnail
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoredTile, StoreShape
from map3d.types import BlockId, Layer, Sun, TileId

COLOR = Layer("color", "color", "png")
PICTURE = Layer("picture", "picture", "png", suns=(Sun(None, 180.0, 45.0, (0.0, -0.7071, 0.7071)),), radius_m=20.0)
NORMAL, ID = Layer("normal", "normal", "png"), Layer("id", "id", "png")
TILE_PX = 256
UP, AWAY = (0, 0, 32767), tuple(round(-axis * 32767) for axis in DEFAULT_LIGHT.towards)


def color_png(pixels: NDArray[np.uint16]) -> bytes:
    return _core.encode_layer("color", "png", pixels)


def painted(rgb: tuple[int, int, int], window: tuple[int, int, int, int], side: int = TILE_PX) -> NDArray[np.uint16]:
    """Returns linear premultiplied pixels with one rectangle (left, top, right, bottom)."""
    left, top, right, bottom = window
    pixels = np.zeros((side, side, 4), np.uint16)
    pixels[top:bottom, left:right] = (*rgb, 65535)
    return pixels


def store_of(folder, zmax: int, layers: tuple[Layer, ...], tiles: dict[tuple[int, TileId], bytes]) -> SqliteTileStore:
    store = SqliteTileStore.create(folder / "view.sqlite", StoreShape(TILE_PX, zmax, layers))
    store.put_block(BlockId(0, 0, 0), "key", 1, [StoredTile(number, *tile, data) for (number, tile), data in tiles.items()], None)
    return store


def picture_of(thumbnail: Thumbnail | None) -> NDArray[np.uint8]:
    assert thumbnail is not None
    with Image.open(BytesIO(base64.b64decode(thumbnail.webp))) as image:
        return np.asarray(image.convert("RGBA"))


def test_it_shows_the_content_alone_in_at_most_64_pixels(tmp_path):
    pixels = painted((65535, 0, 0), (10, 20, 210, 120))
    with store_of(tmp_path, 0, (PICTURE,), {(0, TileId(0, 0, 0)): color_png(pixels)}) as store:
        thumbnail = make_thumbnail(store)
    assert thumbnail is not None
    assert thumbnail.window == (10, 20, 200, 100)
    picture = picture_of(thumbnail)
    assert picture.shape == (25, 50, 4)
    assert max(picture.shape) <= SIDE_PX
    assert np.abs(picture.astype(int) - (255, 0, 0, 255)).max() < 12
    assert len(thumbnail.webp) < 800


def test_small_content_is_read_from_a_finer_level(tmp_path):
    tiles = {(0, TileId(0, 0, 0)): color_png(painted((0, 65535, 0), (120, 120, 136, 136)))}
    for x, y, window in ((0, 0, (240, 240, 256, 256)), (1, 0, (0, 240, 16, 256)), (0, 1, (240, 0, 256, 16)), (1, 1, (0, 0, 16, 16))):
        tiles[0, TileId(1, x, y)] = color_png(painted((0, 65535, 0), window))
    for x, y in ((1, 1), (2, 1), (1, 2), (2, 2)):
        window = (224 if x == 1 else 0, 224 if y == 1 else 0, 256 if x == 1 else 32, 256 if y == 1 else 32)
        tiles[0, TileId(2, x, y)] = color_png(painted((0, 65535, 0), window))
    with store_of(tmp_path, 2, (PICTURE,), tiles) as store:
        thumbnail = make_thumbnail(store)
    assert thumbnail is not None
    assert thumbnail.window == (120, 120, 16, 16)
    picture = picture_of(thumbnail)
    assert picture.shape == (64, 64, 4)
    assert (picture[..., 3] == 255).all()


@pytest.mark.parametrize(("normal", "beam"), [(UP, DEFAULT_LIGHT.towards[2]), (AWAY, 0.0), (None, 0.5)])
def test_colours_are_lit_by_the_default_light(tmp_path, normal, beam):
    grey = 30000
    tiles = {(0, TileId(0, 0, 0)): color_png(painted((grey, grey, grey), (0, 0, 64, 64)))}
    layers: tuple[Layer, ...] = (COLOR,)
    if normal is not None:
        layers = (COLOR, NORMAL)
        normals = np.zeros((TILE_PX, TILE_PX, 3), np.int16)
        normals[:64, :64] = normal
        tiles[1, TileId(0, 0, 0)] = _core.encode_layer("normal", "png", normals)
    with store_of(tmp_path, 0, layers, tiles) as store:
        picture = picture_of(make_thumbnail(store))
    linear = grey / 65535 * (AMBIENT + DIFFUSE * beam)
    expected = 255 * (1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.abs(picture[..., :3].astype(float) - expected).max() < 6


def test_ids_tell_where_an_opaque_format_has_content(tmp_path):
    ids = np.zeros((TILE_PX, TILE_PX), np.uint32)
    ids[100:120, 30:90] = 7
    opaque = np.full((TILE_PX, TILE_PX, 4), 65535, np.uint16)
    color = Layer("color", "color", "jpeg")
    tiles = {(0, TileId(0, 0, 0)): _core.encode_layer("color", "jpeg", opaque), (1, TileId(0, 0, 0)): _core.encode_layer("id", "png", ids)}
    with store_of(tmp_path, 0, (color, ID), tiles) as store:
        thumbnail = make_thumbnail(store)
    assert thumbnail is not None
    assert thumbnail.window == (30, 100, 60, 20)


def test_equal_tiles_give_equal_bytes(tmp_path):
    made = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        noise = np.random.default_rng(3).integers(0, 65536, (TILE_PX, TILE_PX, 4), dtype=np.uint16)
        noise[..., 3] = 65535
        with store_of(tmp_path / name, 0, (COLOR,), {(0, TileId(0, 0, 0)): color_png(noise)}) as store:
            made.append(make_thumbnail(store))
    assert made[0] is not None
    assert made[0] == made[1]


@pytest.mark.parametrize("data", [None, b"nonsense"])
def test_without_a_sound_tile_there_is_none(tmp_path, data):
    tiles = {} if data is None else {(0, TileId(0, 0, 0)): data}
    with store_of(tmp_path, 0, (COLOR,), tiles) as store:
        assert make_thumbnail(store) is None


def test_without_colours_there_is_none(tmp_path):
    tiles = {(0, TileId(0, 0, 0)): _core.encode_layer("id", "png", np.ones((TILE_PX, TILE_PX), np.uint32))}
    with store_of(tmp_path, 0, (ID,), tiles) as store:
        assert make_thumbnail(store) is None
