"""Files with equal names in several folders: adding one never changes the names and object ids of those that are there."""

import shutil
from pathlib import Path
from zlib import crc32

import pytest

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import import_files
from map3d.ingest.import_options import ImportOptions
from map3d.registry import Registry
from map3d.site.files import ImportSummary, SiteFiles, update_files
from tests.ingest.terrain.rasters import colours, hills
from tests.ingest.terrain.rasters import write as write_raster
from tests.odd_cities.towns import write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

OPTIONS = ImportOptions(crs="local")


def write(city: Path, name: str) -> None:
    """Writes a file whose gml:ids begin with its path, which also determines its place."""
    place = (100.0 * (crc32(name.encode()) % 97), 0.0, 0.0)
    write_citygml(city / name, None, lambda corners: corners + place, side=1, prefix=name.replace("/", "-").replace(".", "-") + "-")


def ids(workspace: Workspace) -> dict[str, tuple[str, int]]:
    """Returns gml:id → asset and object id."""
    with Registry(workspace.registry_path("town")) as registry:
        return {item.name: (item.asset, item.id) for item in registry.objects()}


def update(workspace: Workspace, city: Path) -> ImportSummary:
    catalogue = workspace.open_catalogue()
    try:
        return update_files(workspace, catalogue, SiteFiles(SceneRecord("town"), city, OPTIONS), lambda *_: None)
    finally:
        catalogue.close()


@pytest.mark.parametrize("added", ["a/town.gml", "a.gml", "a/TOWN.gml"])
def test_a_file_added_to_a_site_changes_no_ids(tmp_path: Path, added: str) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    for name in ("b/town.gml", "c/town.gml"):
        write(city, name)
    assert update(workspace, city).imported == ["town", "town-2"]
    before = ids(workspace)
    write(city, added)
    summary = update(workspace, city)
    assert len(summary.imported) == 1
    assert (sorted(summary.unchanged), summary.again, summary.removed) == (["town", "town-2"], {}, [])
    after = ids(workspace)
    assert before.items() < after.items()

    (city / "b" / "town.gml").unlink()
    (city / "b").rmdir()
    assert update(workspace, city).removed == ["town"]
    rest = {name: place for name, place in after.items() if not name.startswith("b-")}
    assert ids(workspace) == rest
    write(city, "b/town.gml")
    assert update(workspace, city).imported == ["town"]
    assert rest.items() < ids(workspace).items()


@pytest.mark.parametrize("added", ["a.tif", "photo.tif"])
def test_a_raster_added_to_a_terrain_changes_no_ids(tmp_path: Path, added: str) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    city.mkdir()
    write_raster(city / "dem.tif", hills(8, 8))
    assert update(workspace, city).imported == ["dem"]
    before = ids(workspace)
    write_raster(city / added, colours(16, 16), 0.5)
    summary = update(workspace, city)
    assert (summary.imported, summary.removed) == (["dem"], [])
    assert ids(workspace) == before


def test_a_file_added_by_hand_changes_no_ids(tmp_path: Path) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    write(city, "b/town.gml")
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    import_files(workspace, catalogue, "town", [city], OPTIONS)
    before = ids(workspace)
    write(city, "a/town.gml")
    import_files(workspace, catalogue, "town", [city], OPTIONS)
    catalogue.close()
    after = ids(workspace)
    assert before.items() < after.items()
    assert {asset for asset, _ in after.values()} == {"town", "town-2"}


def add(workspace: Workspace, path: Path) -> tuple[str, bool]:
    """Imports one file; returns the name of the asset, and whether it replaced one."""
    catalogue = workspace.open_catalogue()
    if not catalogue.scenes():
        catalogue.create_scene(SceneRecord("town"))
    (done,) = import_files(workspace, catalogue, "town", [path], OPTIONS).imported
    catalogue.close()
    return done.asset, done.replaced


def test_a_given_file_of_another_folder_replaces_nothing(tmp_path: Path) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    for name in ("a/town.gml", "b/town.gml"):
        write(city, name)
    assert [add(workspace, city / name) for name in ("a/town.gml", "b/town.gml")] == [("town", False), ("b-town", False)]
    before = ids(workspace)
    assert {asset for asset, _ in before.values()} == {"town", "b-town"}
    assert [add(workspace, city / name) for name in ("b/town.gml", "a/town.gml")] == [("b-town", True), ("town", True)]
    assert ids(workspace) == before


def test_a_moved_file_keeps_its_name_and_ids(tmp_path: Path) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    write(city, "a/town.gml")
    assert add(workspace, city / "a" / "town.gml") == ("town", False)
    before = ids(workspace)
    city.rename(tmp_path / "moved")
    assert add(workspace, tmp_path / "moved" / "a" / "town.gml") == ("town", True)
    assert ids(workspace) == before


@pytest.mark.parametrize("inside", [False, True])
def test_copies_of_a_folder_and_its_workspace_have_equal_names_and_ids(tmp_path: Path, inside: bool) -> None:
    files = "workspace/files" if inside else "files"
    workspace = Workspace(tmp_path / "one" / "workspace").create()
    write(tmp_path / "one" / files, "town.gml")
    add(workspace, tmp_path / "one" / files / "town.gml")
    shutil.copytree(tmp_path / "one", tmp_path / "two")
    copy = Workspace(tmp_path / "two" / "workspace")
    assert add(copy, tmp_path / "two" / files / "town.gml") == ("town", True), "although the first one is still there"
    assert ids(copy) == ids(workspace)
    fresh = Workspace(tmp_path / "three").create()
    assert add(fresh, tmp_path / "two" / files / "town.gml") == ("town", False)
    assert ids(fresh) == ids(workspace)


def test_a_file_in_the_workspace_replaces_its_name(tmp_path: Path) -> None:
    """Uploads of one name come in folders of their own."""
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    write(city, "town.gml")
    add(workspace, city / "town.gml")
    for upload in ("1", "2"):
        write(workspace.root / "uploads" / upload, "town.gml")
        assert add(workspace, workspace.root / "uploads" / upload / "town.gml") == ("town", True)


def add_folder(workspace: Workspace, folder: Path) -> dict[str, bool]:
    """Imports the files of a folder; returns the names of their assets, and whether they replaced one."""
    catalogue = workspace.open_catalogue()
    if not catalogue.scenes():
        catalogue.create_scene(SceneRecord("town"))
    done = import_files(workspace, catalogue, "town", [folder], OPTIONS)
    catalogue.close()
    return {item.asset: item.replaced for item in done.imported}


def test_a_second_folder_with_equal_names_replaces_nothing(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path / "workspace").create()
    for name in ("a/town.gml", "a/sub/town.gml", "a/mill.gml", "b/town.gml", "b/sub/town.gml", "b/other.gml"):
        write(tmp_path, name)
    for folder in ("a", "b"):
        write_raster(tmp_path / folder / "dem.tif", hills(8, 8))
    first = add_folder(workspace, tmp_path / "a")
    assert first == {"mill": False, "town": False, "town-2": False, "dem": False}
    before = ids(workspace)
    second = add_folder(workspace, tmp_path / "b")
    assert second == {"other": False, "sub-town": False, "b-town": False, "b-dem": False}
    after = ids(workspace)
    assert before.items() < after.items()
    for folder, names in (("b", second), ("a", first)):
        assert add_folder(workspace, tmp_path / folder) == dict.fromkeys(names, True)
    assert ids(workspace) == after

    (tmp_path / "a").rename(tmp_path / "c")
    assert add_folder(workspace, tmp_path / "c") == dict.fromkeys(first, True), "the folder was moved"
    assert ids(workspace) == after


def test_a_file_of_another_folder_is_not_taken_for_a_removed_numbered_one(tmp_path: Path) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    for name in ("b/town.gml", "c/town.gml"):
        write(city, name)
    update(workspace, city)
    before = ids(workspace)
    shutil.rmtree(city / "c")
    assert update(workspace, city).removed == ["town-2"]
    write(city, "d/town.gml")
    assert update(workspace, city).imported == ["town-3"]
    write(city, "c/town.gml")
    assert update(workspace, city).imported == ["town-2"]
    assert before.items() < ids(workspace).items()


@pytest.mark.parametrize("moved", [False, True])
def test_a_numbered_file_that_returns_alone_has_its_name_and_ids_back(tmp_path: Path, moved: bool) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    for name in ("b/town.gml", "c/town.gml", "mill.gml"):
        write(city, name)
    assert update(workspace, city).imported == ["town", "town-2", "mill"]
    before = ids(workspace)
    for folder in ("b", "c"):
        shutil.rmtree(city / folder)
    assert sorted(update(workspace, city).removed) == ["town", "town-2"]
    if moved:
        city = city.rename(tmp_path / "elsewhere")
    write(city, "c/town.gml")
    assert update(workspace, city).imported == ["town-2"]
    mine = {name: place for name, place in before.items() if not name.startswith("b-")}
    assert ids(workspace) == mine
    write(city, "b/town.gml")
    assert update(workspace, city).imported == ["town"]
    assert ids(workspace) == before


def test_a_removal_of_an_earlier_version_is_completed(tmp_path: Path) -> None:
    """It listed the names of the assets alone."""
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    for name in ("town.gml", "mill.gml"):
        write(city, name)
    update(workspace, city)
    (workspace.scene_folder("town") / "assets" / ".removing").write_text('["mill"]')
    (city / "mill.gml").unlink()
    assert update(workspace, city).removed == []
    assert {asset for asset, _ in ids(workspace).values()} == {"town"}
