import json
import os
import subprocess
import sys
from hashlib import sha256

import httpx
import pytest
from pmtiles.reader import MemorySource, Reader, all_tiles
from pmtiles.tile import Compression, TileType, zxy_to_tileid

from map3d.errors import AlreadyExists, BadRequest, Corrupt, NotFound, Stopped
from map3d.publish import publish
from map3d.publish.checksums import CHECKSUMS, dump_checksums, file_digest, parse_checksums
from map3d.registry import Registry
from map3d.tiles import viewer_files
from map3d.tiles.manifest import Manifest
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId
from map3d.verify.published_checks import verify_published
from tests.publish.hosts import static_host
from tests.web.workspaces import ADDED, LAYERS, OCCUPIED, ZMAX, add_pass, every_tile, put_block, tile_bytes

VIEWS = ("0-45", "45-22.5")


def contents(path):
    return {file.relative_to(path).as_posix(): file.read_bytes() for file in path.rglob("*") if file.is_file()}


def archive(folder, view, layer):
    """Returns the only archive of a layer, whose name ends with its content's digest."""
    (path,) = (folder / view).glob(f"{layer}-*.pmtiles")
    return path


def tiles_of(path):
    return {zxy: bytes(data) for zxy, data in all_tiles(MemorySource(path.read_bytes()))}


def test_the_folder_is_complete(workspace, out):
    done = publish(workspace, "tea", out)
    names = {
        "rendering.json",
        "README.txt",
        "web.config",
        "preview.jpg",
        "favicon.ico",
        "checksums.sha256",
        "index.html",
        "assets/worker.js",
        "objects/0.json",
        "objects/search.json",
    }
    names |= {archive(out, view, layer.name).relative_to(out).as_posix() for view in VIEWS for layer in LAYERS}
    index = json.loads((out / "objects" / "attributes.json").read_text())
    names |= {"objects/attributes.json", *(f"objects/columns/{row['column']}.json" for row in index["attributes"])}
    assert set(contents(out)) == names
    assert (done.tiles, done.archives, done.kept) == (len(every_tile()) * 8, 8, 0)
    assert done.bytes == sum(map(len, contents(out).values()))
    assert not list(out.parent.glob(".public*"))


def test_every_tile_is_byte_identical_to_the_stores(workspace, out):
    publish(workspace, "tea", out)
    for view in VIEWS:
        for layer in LAYERS:
            assert tiles_of(archive(out, view, layer.name)) == {tuple(tile): tile_bytes(view, layer.name, tile) for tile in every_tile()}


def test_added_layers_are_published(workspace, out):
    publish(workspace, "tea", out)
    before = {view: archive(out, view, "color").read_bytes() for view in VIEWS}
    add_pass(workspace)
    done = publish(workspace, "tea", out)
    assert (done.tiles, done.archives) == (len(every_tile()) * 12, 12)
    for view in VIEWS:
        assert archive(out, view, "color").read_bytes() == before[view]
        for layer in (*LAYERS, *ADDED):
            assert tiles_of(archive(out, view, layer.name)) == {tuple(tile): tile_bytes(view, layer.name, tile) for tile in every_tile()}
    manifest = Manifest.load((out / "rendering.json").read_bytes())
    assert manifest.view("0-45").archives == {layer.name: archive(out, "0-45", layer.name).relative_to(out).as_posix() for layer in (*LAYERS, *ADDED)}
    assert [[layer.name for layer in layers] for layers in manifest.passes] == [["color", "normal", "id", "depth"], ["again", "coarse"]]
    found = verify_published(out, workspace)
    assert (found.archives, found.tiles) == (12, len(every_tile()) * 12)


def test_tiles_are_sorted_and_equal_ones_stored_once(workspace, out):
    publish(workspace, "tea", out)
    path = archive(out, "0-45", "color")
    header = Reader(MemorySource(path.read_bytes())).header()
    assert header["clustered"]
    assert header["addressed_tiles_count"] == len(every_tile())
    distinct = {tile_bytes("0-45", "color", tile) for tile in every_tile()}
    assert header["tile_contents_count"] == len(distinct) < len(every_tile())
    ordered = sorted(every_tile(), key=lambda tile: zxy_to_tileid(*tile))
    assert list(tiles_of(path)) == [tuple(tile) for tile in ordered]
    assert (header["min_zoom"], header["max_zoom"]) == (0, ZMAX)


def test_archives_describe_their_layer(workspace, out):
    publish(workspace, "tea", out)
    for layer, kind in (("color", TileType.WEBP), ("depth", TileType.PNG)):
        reader = Reader(MemorySource(archive(out, "0-45", layer).read_bytes()))
        assert (reader.header()["tile_type"], reader.header()["tile_compression"]) == (kind, Compression.NONE)
        assert reader.metadata()["attribution"] == "© City of Tea"
        assert reader.metadata()["map3d"]["layer"] == layer


def test_the_manifest_names_the_archives_and_only_versions_differ(workspace, out):
    publish(workspace, "tea", out)
    got, original = (json.loads(path.read_text()) for path in (out / "rendering.json", workspace.manifest_path("tea")))
    for view in got["views"]:
        archives = view.pop("archives")
        assert archives == {layer.name: archive(out, view["id"], layer.name).relative_to(out).as_posix() for layer in LAYERS}
        assert (view.pop("version"), view.pop("versions")) == (got["content_version"], {})
    for view in original["views"]:
        del view["version"], view["versions"]
    del got["content_version"], original["content_version"]
    assert got == original


def test_objects_equal_those_of_the_registry(workspace, out):
    publish(workspace, "tea", out)
    with Registry(workspace.registry_path("town")) as registry:
        documents = dict(registry.documents())
        assert json.loads(documents["objects/0.json"]) == json.loads(json.dumps(registry.shard(0)))
    assert len(documents) > 4
    assert {path.relative_to(out).as_posix(): path.read_bytes() for path in (out / "objects").rglob("*.json")} == documents


def test_a_static_host_with_range_requests_suffices(workspace, out):
    publish(workspace, "tea", out)
    with static_host(out) as address, httpx.Client(base_url=address) as client:
        manifest = Manifest.load(client.get("/rendering.json").content)
        assert client.get("/").text.startswith("<!doctype html>")
        for view in manifest.views:
            for layer, path in view.archives.items():
                asked = []

                def ranges(offset, length, path=path, asked=asked):
                    asked.append(length)
                    response = client.get(f"/{path}", headers={"Range": f"bytes={offset}-{offset + length - 1}"})
                    assert response.status_code == 206
                    return response.content

                reader = Reader(ranges)
                for tile in every_tile()[::5]:
                    assert reader.get(*tile) == tile_bytes(view.frame.id, layer, tile)
                assert reader.get(ZMAX, 15, 0) is None


def test_the_readme_explains_range_requests(workspace, out):
    publish(workspace, "tea", out)
    text = (out / "README.txt").read_text()
    assert "range requests" in text
    assert "http.server" in text
    assert text.startswith("Tea <time>\n© City of Tea\n")


def test_sha256sum_can_check_a_copy(workspace, out):
    publish(workspace, "tea", out)
    for line in (out / "checksums.sha256").read_text().splitlines():
        digest, name = line.split("  ")
        assert sha256((out / name).read_bytes()).hexdigest() == digest
    assert len((out / "checksums.sha256").read_text().splitlines()) == len(contents(out)) - 1


def test_publishing_twice_gives_equal_bytes(workspace, out):
    publish(workspace, "tea", out)
    publish(workspace, "tea", out.with_name("again"))
    assert contents(out) == contents(out.with_name("again"))


def test_a_published_folder_is_updated_and_files_of_others_in_it_stay(workspace, out):
    publish(workspace, "tea", out)
    before = contents(out)
    (out / "CNAME").write_text("tea.example.org")
    (out / "objects" / "17.json").write_text("an old shard")
    publish(workspace, "tea", out)
    assert contents(out) == before | {"CNAME": b"tea.example.org"}
    assert not list(out.parent.glob(".public*"))


def other_map(kind):
    """Returns what to replace in the manifest of a publication so that it is another city's."""
    return ('"name": "tea"', '"name": "coffee"') if kind == "rendering" else ("691000.0", "691001.0")


@pytest.mark.parametrize("kind", ["rendering", "scene"])
@pytest.mark.parametrize("in_store", [False, True])
def test_the_map_of_another_city_is_replaced_only_on_request(workspace, out, kind, in_store):
    target = out.as_uri() if in_store else out
    publish(workspace, "tea", target)
    own = contents(out)
    manifest, (old, new) = (out / "rendering.json").read_text(), other_map(kind)
    assert old in manifest
    (out / "rendering.json").write_text(manifest.replace(old, new))
    sums = parse_checksums((out / CHECKSUMS).read_bytes()) | {"rendering.json": file_digest(out / "rendering.json")}
    (out / CHECKSUMS).write_bytes(dump_checksums(sums))
    before = contents(out)
    for dry_run in (False, True):
        with pytest.raises(AlreadyExists, match=rf"another {kind}.*--replace"):
            publish(workspace, "tea", target, dry_run=dry_run)
    assert contents(out) == before
    publish(workspace, "tea", target, replace=True)
    assert contents(out) == own


@pytest.mark.parametrize("manifest", ["{", "[]", '{"map3d": "scene"}', '{"map3d": "rendering", "name": "tea"}'])
def test_a_folder_with_another_kind_of_manifest_is_never_replaced(workspace, out, manifest):
    out.mkdir()
    (out / "rendering.json").write_text(manifest)
    with pytest.raises(AlreadyExists, match="not a published rendering"):
        publish(workspace, "tea", out, replace=True)
    assert contents(out) == {"rendering.json": manifest.encode()}


def test_other_folders_are_never_replaced(workspace, out):
    out.mkdir()
    (out / "thesis.txt").write_text("irreplaceable")
    with pytest.raises(AlreadyExists, match="not a published rendering"):
        publish(workspace, "tea", out, replace=True)
    assert contents(out) == {"thesis.txt": b"irreplaceable"}


def test_an_empty_folder_is_filled(workspace, out):
    out.mkdir()
    publish(workspace, "tea", out)
    assert (out / "index.html").is_file()


def test_a_stopped_publish_resumes(workspace, out):
    seen = []
    with pytest.raises(Stopped, match="to resume"):
        publish(workspace, "tea", out, progress=lambda *step: seen.append(step) or len(seen) < 4)
    assert not out.exists()
    done = publish(workspace, "tea", out)
    assert done.kept == 3
    assert verify_published(out, workspace).archives == 8


def test_a_killed_publish_leaves_no_folder(workspace, out, tmp_path, built_viewer):
    script = (
        "import os, sys; from pathlib import Path\n"
        "from map3d.catalogue import Workspace; from map3d.publish import publish; from map3d.tiles import viewer_files\n"
        "viewer_files.files = lambda _: Path(sys.argv[3])\n"
        "die = lambda stage, done, total: os.kill(os.getpid(), 9) if done > 40 else True\n"
        "publish(Workspace(Path(sys.argv[1])), 'tea', Path(sys.argv[2]), progress=die)\n"
    )
    command = [sys.executable, "-c", script, str(workspace.root), str(out), str(built_viewer.parent)]
    assert subprocess.run(command, check=False, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}).returncode == -9
    assert not out.exists()
    publish(workspace, "tea", out)
    reference = out.with_name("reference")
    publish(workspace, "tea", reference)
    assert contents(out) == contents(reference)


def test_equal_tiles_give_equal_folders_however_they_were_rendered(workspace, out, tmp_path):
    """A render that was stopped and resumed has higher versions than one that was not."""
    publish(workspace, "tea", out)
    for path in workspace.rendering_folder("tea").glob("*.sqlite"):
        with SqliteTileStore(path) as store:
            store.remove_block(BlockId(1, 0, 0))
            put_block(store, path.stem, BlockId(1, 0, 0), Occupancy.from_tiles(ZMAX, OCCUPIED), version=2)
    value = json.loads(workspace.manifest_path("tea").read_text())
    value["content_version"] = 2
    for view in value["views"]:
        view["versions"] = {"1/0/0": 2}
    workspace.manifest_path("tea").write_text(json.dumps(value))
    publish(workspace, "tea", tmp_path / "resumed")
    assert contents(out) == contents(tmp_path / "resumed")


def test_content_version_of_a_folder_changes_with_its_tiles(workspace, out, tmp_path):
    publish(workspace, "tea", out)
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        put_block(store, "0-45", BlockId(1, 0, 0), Occupancy.from_tiles(ZMAX, OCCUPIED), salt="new")
    publish(workspace, "tea", tmp_path / "changed")
    before, after = (json.loads((folder / "rendering.json").read_text()) for folder in (out, tmp_path / "changed"))
    assert before["content_version"] != after["content_version"]
    assert 1 <= after["content_version"] < 2**48
    assert [view["version"] for view in after["views"]] == [after["content_version"]] * 2


def test_archives_of_other_tiles_are_not_reused(workspace, out):
    with pytest.raises(Stopped):
        publish(workspace, "tea", out, progress=lambda stage, done, total: done < total / 2)
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        put_block(store, "0-45", BlockId(1, 0, 0), Occupancy.from_tiles(ZMAX, OCCUPIED), version=2, salt="new")
    done = publish(workspace, "tea", out)
    assert done.kept == 0
    verify_published(out, workspace)


def test_damaged_archives_are_not_reused(workspace, out):
    with pytest.raises(Stopped):
        publish(workspace, "tea", out, progress=lambda stage, done, total: done < total / 2)
    draft = out.with_name(".public.publishing")
    for path in sorted(draft.rglob("*.pmtiles")):
        os.truncate(path, path.stat().st_size - 5)
    assert publish(workspace, "tea", out).kept == 0
    verify_published(out, workspace)


def test_tiles_that_change_during_publishing_are_detected(workspace, out):
    def render_on(*_):
        with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
            put_block(store, "0-45", BlockId(1, 0, 0), Occupancy.from_tiles(ZMAX, OCCUPIED), version=2, salt="new")
        return True

    with pytest.raises(Corrupt, match="changed"):
        publish(workspace, "tea", out, progress=render_on)
    assert not out.exists()


def test_an_incomplete_rendering_needs_permission(workspace, out):
    path = workspace.manifest_path("tea")
    path.write_text(path.read_text().replace('"complete": true', '"complete": false'))
    with pytest.raises(BadRequest, match="map3d render"):
        publish(workspace, "tea", out)
    publish(workspace, "tea", out, allow_incomplete=True)


def test_an_empty_layer_has_no_archive(workspace, out):
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        for block in store.list_blocks():
            store.put_block(block.id, "empty", 2, [], None)
    value = json.loads(workspace.manifest_path("tea").read_text())
    value["views"][0]["occupancy"] = "AA=="
    workspace.manifest_path("tea").write_text(json.dumps(value))
    done = publish(workspace, "tea", out)
    assert done.archives == 4
    assert json.loads((out / "rendering.json").read_text())["views"][0]["archives"] == {}
    verify_published(out, workspace)


def test_an_unknown_rendering_is_not_found(workspace, out):
    with pytest.raises(NotFound):
        publish(workspace, "none", out)


def test_without_the_viewer_nothing_is_written(workspace, out, tmp_path, monkeypatch):
    monkeypatch.setattr(viewer_files, "files", lambda _: tmp_path / "nowhere")
    with pytest.raises(viewer_files.ViewerMissing, match="make build"):
        publish(workspace, "tea", out)
    assert not list(out.parent.glob(".public*"))


def test_progress_counts_every_tile(workspace, out):
    seen = []
    publish(workspace, "tea", out, progress=lambda *step: seen.append(step) or True)
    total = len(every_tile()) * 8
    tiles = [step for step in seen if step[0] == "tiles"]
    assert [step[1] for step in tiles] == sorted(step[1] for step in tiles)
    assert tiles[-1] == ("tiles", total, total)
