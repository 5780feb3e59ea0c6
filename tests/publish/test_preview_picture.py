"""The picture for links to a map, and the head of its page."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from map3d.errors import Corrupt
from map3d.publish import publish
from map3d.publish.page_head import describe_page
from map3d.publish.preview_picture import BACKGROUND, make_preview
from map3d.tiles.manifest import Manifest
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoredTile
from map3d.tiles.track_stores import rendering_record


def manifest_of(workspace):
    return Manifest.load(workspace.manifest_path("tea").read_bytes())


def picture_of(workspace):
    data = make_preview(workspace, rendering_record(workspace, "tea"), manifest_of(workspace))
    with Image.open(BytesIO(data)) as opened:
        return np.asarray(opened.convert("RGB")).astype(int)


def test_the_picture_shows_tiles_where_they_are_and_paper_elsewhere(workspace):
    pixels = picture_of(workspace)
    assert pixels.shape == (630, 1200, 3)
    tile = np.abs(pixels - (200, 120, 60)).max(axis=2) < 12
    paper = np.abs(pixels - BACKGROUND).max(axis=2) < 12
    assert tile.mean() > 0.05
    assert paper.mean() > 0.05
    assert (tile | paper).mean() > 0.97


def test_equal_tiles_give_equal_pictures(workspace):
    assert np.array_equal(picture_of(workspace), picture_of(workspace))


def test_a_tile_that_is_no_image_is_named(workspace):
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        for block in store.list_blocks():
            tiles = [StoredTile(0, *tile, b"RIFFnonsense") for tile in store.list_tiles(0) if block_holds(store, block, tile)]
            store.put_block(block.id, "bad", 2, tiles, None)
    with pytest.raises(Corrupt, match=r"tile 0-45/color/.*: not a webp image.*map3d verify"):
        picture_of(workspace)


def block_holds(store, block, tile):
    from map3d.tiles.naming import block_of

    return block_of(tile, store.shape.zmax) == block.id


@pytest.mark.parametrize(
    ("url", "picture"), [(None, "preview.jpg"), ("https://example.org/a/?b=1&c", "https://example.org/a/?b=1&amp;c/preview.jpg")]
)
def test_the_published_page_describes_the_map(workspace, out, built_viewer, url, picture):
    (built_viewer / "index.html").write_text("<!doctype html>\n<html><head>\n<title>map3d</title>\n<link rel=stylesheet href=page.css></head><body>")
    publish(workspace, "tea", out, url=url)
    page = (out / "index.html").read_text()
    assert page.count("<title>") == 1
    assert "<title>Tea &lt;time&gt;</title>" in page
    assert f'<meta property="og:image" content="{picture}">' in page
    assert '<meta property="og:title" content="Tea &lt;time&gt;">' in page
    assert '<meta name="description" content="Oblique map in 2 views. © City of Tea">' in page
    assert page.index("og:image") < page.index("</head>")
    assert ("og:url" in page) == (url is not None)
    with Image.open(out / "preview.jpg") as opened:
        assert opened.size == (1200, 630)


def test_a_page_without_head_stays_valid(workspace):
    page = describe_page("<!DOCTYPE html><script src=x></script>", manifest_of(workspace), None)
    assert page.startswith("<!DOCTYPE html><title>")
    assert page.endswith("<script src=x></script>")
    assert "og:image" not in page
