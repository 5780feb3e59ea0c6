"""Publishing a rendering with data tiles: archives for static hosts, the same bytes each time, readable as published."""

import json
import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from pmtiles.reader import MemorySource, Reader, all_tiles
from pmtiles.tile import Compression, TileType

from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.errors import Corrupt, VerifyFailed
from map3d.publish import publish
from map3d.publish.pmtiles_archive import Archive
from map3d.tiles.decode_tile import decode_tile
from map3d.types import Layer, TileId
from map3d.verify.published_checks import verify_published
from tests.data_tiles.towns import KINDS, VIEW, damage, manifest_of, stored_tiles

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole


@pytest.fixture(scope="session")
def published(rendered: Workspace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folders `png` and `tile`."""
    out = tmp_path_factory.mktemp("published")
    for name in ("png", "tile"):
        publish(rendered, name, out / name)
    return out


def archive(folder: Path, layer: str) -> Path:
    (path,) = (folder / VIEW).glob(f"{layer}-*.pmtiles")
    return path


def archived_tiles(folder: Path, layer: str) -> dict[TileId, bytes]:
    return {TileId(*zxy): bytes(data) for zxy, data in all_tiles(MemorySource(archive(folder, layer).read_bytes()))}


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_folder_has_an_archive_of_data_tiles(published: Path, rendered: Workspace) -> None:
    manifest = json.loads((published / "tile" / "rendering.json").read_text())
    assert set(manifest["views"][0]["archives"]) == {"color", "data", "ao"}
    assert [layer["name"] for layer in manifest["layers"]] == ["color", "data", "ao"]
    path = archive(published / "tile", "data")
    header = Reader(MemorySource(path.read_bytes())).header()
    assert (header["tile_type"], header["tile_compression"]) == (TileType.UNKNOWN, Compression.NONE)
    assert archived_tiles(published / "tile", "data") == stored_tiles(rendered, "tile", "data")
    assert not list((published / "tile").rglob("normal-*"))


def test_published_pixels_are_those_of_the_published_png_layers(published: Path) -> None:
    tiles = archived_tiles(published / "tile", "data")
    for kind in KINDS:
        pngs = archived_tiles(published / "png", kind)
        assert set(pngs) == set(tiles)
        for tile, png in pngs.items():
            expected = decode_tile(Layer(kind, kind, "png"), png, 256)[kind]  # type: ignore[arg-type]
            assert np.array_equal(decode_tile(Layer("data", "data", "m3d"), tiles[tile], 256)[kind], expected)
    for layer in ("color", "ao"):
        assert archived_tiles(published / "tile", layer) == archived_tiles(published / "png", layer)


def test_publishing_again_writes_the_same_bytes(published: Path, workspace: Workspace, tmp_path: Path) -> None:
    publish(workspace, "tile", tmp_path / "out")
    first = contents(published / "tile")
    assert contents(tmp_path / "out") == first
    done = publish(workspace, "tile", tmp_path / "out")
    assert (done.kept, done.archives) == (3, 3)
    assert contents(tmp_path / "out") == first


def test_both_publications_show_the_same_preview_and_content(published: Path) -> None:
    assert (published / "tile" / "preview.jpg").read_bytes() == (published / "png" / "preview.jpg").read_bytes()
    sizes = {name: sum(path.stat().st_size for path in (published / name).rglob("*.pmtiles")) for name in ("png", "tile")}
    assert sizes["tile"] < sizes["png"]


def test_a_publication_is_verified_against_its_store(published: Path, rendered: Workspace) -> None:
    found = verify_published(published / "tile", rendered)
    assert found.archives == 3
    assert found.tiles == 3 * manifest_of(rendered, "tile").views[0].occupancy.count()


def test_a_publication_with_other_bytes_than_data_tiles_is_refused(published: Path, workspace: Workspace, tmp_path: Path) -> None:
    tile = damage(workspace, "tile", "data", b"nothing")
    folder = tmp_path / "out"
    publish(workspace, "tile", folder)
    with pytest.raises(VerifyFailed, match=f"tile {tile.z}/{tile.x}/{tile.y} is not m3d"):
        verify_published(folder)
    other = tmp_path / "other"
    shutil.copytree(published / "tile", other)
    with pytest.raises(VerifyFailed, match="differs from the store"):
        verify_published(other, workspace)


def test_an_archive_of_images_is_not_one_of_data_tiles(published: Path) -> None:
    opened = Archive(archive(published / "png", "id"))
    assert opened.has_format_of(Layer("id", "id", "png"))
    assert not opened.has_format_of(Layer("data", "data", "m3d"))
    assert Archive(archive(published / "tile", "data")).has_format_of(Layer("data", "data", "m3d"))
    with pytest.raises(Corrupt):
        Archive(published / "tile" / "rendering.json")


def test_gis_files_hold_the_colours_alone(workspace: Workspace, tmp_path: Path) -> None:
    publish(workspace, "tile", tmp_path / "out", gis=True)
    names = {path.relative_to(tmp_path / "out" / "gis").parts[1] for path in (tmp_path / "out" / "gis").glob("*/*")}
    assert names == {"color"}


def test_mbtiles_of_data_tiles_name_their_media_type(workspace: Workspace, tmp_path: Path) -> None:
    out = tmp_path / "a.mbtiles"
    assert run(["export", "tile", "--to", "mbtiles", "--view", VIEW, "--layer", "data", "-o", str(out), "-w", str(workspace.root)]) == 0
    db = sqlite3.connect(out)
    assert db.execute("SELECT value FROM metadata WHERE name = 'format'").fetchall() == [("application/vnd.map3d.data",)]
    db.close()


def test_a_deep_zoom_image_of_data_tiles_is_refused(workspace: Workspace, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.dzi"
    assert run(["export", "tile", "--to", "dzi", "--view", VIEW, "--layer", "data", "-o", str(out), "-w", str(workspace.root)]) == 2
    assert "data tiles are no images; export normal, id, depth" in capfd.readouterr().err
    assert not list(tmp_path.glob("*a*"))
