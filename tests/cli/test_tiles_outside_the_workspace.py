"""A rendering whose tiles are in a folder or an object store: every command treats it like one with SQLite files."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.object_store import open_object_store
from map3d.tiles.manifest import Manifest
from map3d.tiles.track_stores import open_track, rendering_record
from map3d.web.server.asgi_app import create_app
from tests.cli.towns import Run, house, write_town
from tests.web.conftest import Client

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole

VIEWS = ("--res", "0.05", "--view", "0/45", "--view", "90/30")


def render_town(run: Run, files: Path, workspace: Path, *options: str) -> Workspace:
    """Renders the town, adds a layer, changes a house and renders again."""
    at = ("--workspace", str(workspace))
    write_town(files, side=3)
    for words in (
        ("create-scene", "town"),
        ("add-files", "town", str(files)),
        ("create-rendering", "town", "view", *VIEWS, *options),
        ("render", "view"),
        ("add-layers", "view", "--layers", "again=normal"),
        ("render", "view"),
    ):
        status, _, err = run(*words, *at)
        assert status == 0, err
    (files / "house-0-0.obj").write_text(house(0.0, 0.0, 11.0))
    for words in (("add-files", "town", str(files / "house-0-0.obj")), ("render", "view")):
        status, _, err = run(*words, *at)
        assert status == 0, err
    return Workspace(workspace)


@pytest.fixture
def stored(run: Run, tmp_path: Path, store_url: str) -> Workspace:
    return render_town(run, tmp_path / "files", tmp_path / "stored", "--tiles", store_url)


@pytest.fixture
def embedded(run: Run, tmp_path: Path) -> Workspace:
    """The same rendering in SQLite files."""
    return render_town(run, tmp_path / "files", tmp_path / "embedded")


def published(run: Run, workspace: Workspace, out: Path) -> dict[str, bytes]:
    status, _, err = run("publish", "view", "-o", str(out), "--workspace", str(workspace.root))
    assert status == 0, err
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in out.rglob("*") if path.is_file()}


@pytest.fixture
def client(stored: Workspace) -> Iterator[Client]:
    made = Client(create_app(stored))
    yield made
    made.close()


def test_tiles_are_published_and_served_like_those_of_sqlite(
    run: Run, stored: Workspace, embedded: Workspace, client: Client, tmp_path: Path, store_url: str
) -> None:
    assert not list(stored.rendering_folder("view").glob("*.sqlite"))
    assert stored.manifest_path("view").read_bytes() == embedded.manifest_path("view").read_bytes()
    assert published(run, stored, tmp_path / "a") == published(run, embedded, tmp_path / "b")

    at = ("--workspace", str(stored.root))
    status, out, err = run("verify", "--deep", "--json", *at)
    assert (status, json.loads(out)["wrong"]) == (0, []), err

    shared = open_object_store(f"{store_url}/view").get("rendering.json")
    assert shared is not None
    manifest = Manifest.load(shared[0])
    stored.manifest_path("view").unlink()
    assert client.get("/tiles/view/rendering.json").content == shared[0]
    assert client.get("/renderings").status_code == 200
    for layer in ("color", "again"):
        with open_track(embedded, rendering_record(embedded, "view"), "0-45" if layer == "color" else "0-45+1") as store:
            for tile in list(store.list_tiles(0))[:3]:
                response = client.get(f"/tiles/view/0-45/{layer}/{tile.z}/{tile.x}/{tile.y}?v={manifest.content_version}")
                assert (response.status_code, response.content) == (200, store.get_tile(store.shape.layer_number(layer), *tile))


def test_a_regridded_rendering_keeps_its_place_and_loses_its_tiles(run: Run, stored: Workspace, store_url: str) -> None:
    at = ("--workspace", str(stored.root))
    assert any(name.endswith(".m3b") for name, _ in open_object_store(f"{store_url}/view").list())
    status, _, err = run("create-rendering", "town", "view", *VIEWS, "--regrid", *at)
    assert status == 0, err
    assert not any(name.endswith(".m3b") for name, _ in open_object_store(f"{store_url}/view").list())
    assert rendering_record(stored, "view").options["tiles"] == store_url
    assert run("render", "view", *at)[0] == 0
    assert run("verify", *at)[0] == 0


def test_a_url_with_credentials_is_refused_and_not_repeated(run: Run, tmp_path: Path) -> None:
    write_town(tmp_path / "files", side=1)
    run("create-scene", "town")
    run("add-files", "town", str(tmp_path / "files"))
    status, out, err = run("create-rendering", "town", "view", *VIEWS, "--tiles", "s3://KEY:SECRET@bucket/tiles")
    assert status == 2
    assert "environment" in err
    assert "SECRET" not in out + err
    assert "\nview" not in run("show", "renderings")[1]


def test_another_node_renders_a_shared_scene(run: Run, embedded: Workspace, tmp_path: Path, store_url: str) -> None:
    """The other node has the catalogue, and nothing else of the workspace."""
    host, node = ("--workspace", str(tmp_path / "host")), ("--workspace", str(tmp_path / "node"))
    files = write_town(tmp_path / "files", side=3)
    for words in (
        ("create-scene", "town", "--files", f"{store_url}/scenes"),
        ("add-files", "town", str(files)),
        ("create-rendering", "town", "view", *VIEWS, "--tiles", f"{store_url}/tiles"),
        ("add-layers", "view", "--layers", "again=normal"),
    ):
        status, _, err = run(*words, *host)
        assert status == 0, err
    (tmp_path / "node").mkdir()
    (tmp_path / "node" / "catalogue.sqlite").symlink_to(tmp_path / "host" / "catalogue.sqlite")
    status, _, err = run("render", "view", *node)
    assert status == 0, err
    (files / "house-0-0.obj").write_text(house(0.0, 0.0, 11.0))
    for words in (("add-files", "town", str(files / "house-0-0.obj"), *host), ("render", "view", *host), ("render", "view", *node)):
        status, _, err = run(*words)
        assert status == 0, err
    assert not (tmp_path / "host" / "renderings" / "view" / "0-45.sqlite").exists()
    assert run("verify", *host)[0] == run("verify", *node)[0] == 0
    found = published(run, Workspace(tmp_path / "node"), tmp_path / "a")
    (tmp_path / "visitor").mkdir()
    (tmp_path / "visitor" / "catalogue.sqlite").symlink_to(tmp_path / "host" / "catalogue.sqlite")
    assert found == published(run, Workspace(tmp_path / "visitor"), tmp_path / "d"), "a node that did not render"
    assert found == published(run, Workspace(tmp_path / "host"), tmp_path / "b") == published(run, embedded, tmp_path / "c")
