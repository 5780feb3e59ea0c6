import json
import shutil

import pytest

from map3d.errors import Corrupt, NotFound, UnknownVersion, VerifyFailed
from map3d.publish import publish
from map3d.publish.pmtiles_archive import Archive
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId
from map3d.verify.published_checks import verify_published
from tests.web.workspaces import OCCUPIED, ZMAX, add_pass, every_tile, put_block


@pytest.fixture
def folder(workspace, out):
    publish(workspace, "tea", out)
    return out


def archive(folder, layer, view="0-45"):
    (path,) = (folder / view).glob(f"{layer}-*.pmtiles")
    return path


def file_of(folder, name):
    """Returns a file; `0-45/id` is an archive."""
    return archive(folder, "id") if name == "0-45/id" else folder / name


def change(path, find, put):
    data = path.read_bytes()
    assert find in data
    path.write_bytes(data.replace(find, put, 1))


def test_published_folder_has_no_problems(workspace, folder):
    done = verify_published(folder)
    assert (done.files, done.archives, done.tiles) == (15 + 2 + 5, 8, 8 * len(every_tile()))
    assert verify_published(folder, workspace) == done


def test_copied_folder_has_no_problems(folder, tmp_path):
    verify_published(shutil.copytree(folder, tmp_path / "elsewhere"))


@pytest.mark.parametrize(
    "name", ["index.html", "objects/0.json", "objects/search.json", "objects/attributes.json", "0-45/id", "checksums.sha256", "README.txt"]
)
def test_missing_file_is_found(folder, name):
    file_of(folder, name).unlink()
    with pytest.raises(VerifyFailed, match=name):
        verify_published(folder)


@pytest.mark.parametrize(("name", "find", "put"), [("0-45/id", b"0-45/id", b"0-54/id"), ("objects/0.json", b"House", b"Mouse")])
def test_changed_byte_is_found(folder, name, find, put):
    change(file_of(folder, name), find, put)
    with pytest.raises(VerifyFailed, match="has changed"):
        verify_published(folder)


def test_tile_that_differs_from_the_store_is_found(workspace, folder):
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        put_block(store, "0-45", BlockId(1, 0, 0), Occupancy.from_tiles(ZMAX, OCCUPIED), version=2, salt="new")
    verify_published(folder)
    with pytest.raises(VerifyFailed, match="differs from the store"):
        verify_published(folder, workspace)


def test_tile_of_an_added_layer_that_differs_from_the_store_is_found(workspace, out):
    add_pass(workspace)
    publish(workspace, "tea", out)
    verify_published(out, workspace)
    with SqliteTileStore(workspace.store_path("tea", "0-45+1")) as store:
        put_block(store, "0-45", BlockId(1, 0, 0), Occupancy.from_tiles(ZMAX, OCCUPIED), version=3, salt="new")
    with pytest.raises(VerifyFailed, match=r"0-45/again-[0-9a-f]{16}\.pmtiles: tile .* differs from the store"):
        verify_published(out, workspace)


def test_tiles_missing_from_the_manifest_are_found(folder):
    value = json.loads((folder / "rendering.json").read_text())
    value["views"][0]["occupancy"] = Occupancy.from_tiles(ZMAX, [(0, 0), (9, 9)]).encode()
    (folder / "rendering.json").write_text(json.dumps(value))
    with pytest.raises(VerifyFailed, match=r"tiles are missing.*not in the manifest"):
        verify_published(folder)


def test_layer_of_another_format_is_found(folder):
    shutil.copy(archive(folder, "color"), archive(folder, "id"))
    with pytest.raises(VerifyFailed, match="not png"):
        verify_published(folder)


@pytest.mark.parametrize("keep", [0, 7, 100, 300, -1])
def test_truncated_archive_is_found(folder, keep):
    path = archive(folder, "color")
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(VerifyFailed, match=r"color-[0-9a-f]{16}\.pmtiles"):
        verify_published(folder)
    with pytest.raises(Corrupt):
        list(Archive(path).tiles())


def test_folder_without_a_rendering_is_refused(tmp_path):
    with pytest.raises(NotFound):
        verify_published(tmp_path)


def test_manifest_of_another_version_is_refused(folder):
    change(folder / "rendering.json", b'"version": 1', b'"version": 9')
    with pytest.raises(UnknownVersion):
        verify_published(folder)
