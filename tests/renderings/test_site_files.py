"""The scene of a site follows its folder, and no vanished disk empties it."""

import os
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import Catalogue, SceneRecord, Workspace
from map3d.errors import BadRequest, Map3dError, NotFound
from map3d.formats import FORMATS
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import import_file
from map3d.ingest.sources import find_sources, source_digest
from map3d.registry import Registry
from map3d.scenes.build import BUILD_BYTES, build
from map3d.site.files import ImportSummary, SiteFiles, reasons, update_files
from tests.cli.towns import house


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path / "workspace").create()


@pytest.fixture
def catalogue(workspace: Workspace) -> Iterator[Catalogue]:
    opened = workspace.open_catalogue()
    yield opened
    opened.close()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three houses, two of them in the subfolder `north`."""
    for number, name in enumerate(("a.obj", "north/b.obj", "north/c.obj")):
        path = tmp_path / "town" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(house(40.0 * number, 0.0, 6.0))
    return tmp_path / "town"


class Site:
    """Updates the scene `town` from a folder."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue) -> None:
        self.workspace, self.catalogue = workspace, catalogue

    def update(self, folder: Path, options: ImportOptions | None = None, *, allow_empty: bool = False) -> ImportSummary:
        files = SiteFiles(SceneRecord("town"), folder, options or ImportOptions(), allow_empty)
        return update_files(self.workspace, self.catalogue, files, lambda *_: None)

    def assets(self) -> list[str]:
        return [asset.name for asset in self.catalogue.assets("town")]

    def drawn(self) -> set[str]:
        """Returns the assets whose objects a build draws, checked in registry and folders too."""
        build(self.workspace, self.catalogue, "town", threads=1, max_memory_bytes=BUILD_BYTES)
        with Registry(self.workspace.registry_path("town")) as registry:
            drawn = {item.asset for item in registry.objects() if item.box is not None and item.asset != "_scene"}
        assert drawn == {path.name for path in (self.workspace.scene_folder("town") / "assets").iterdir()} == set(self.assets())
        return drawn


@pytest.fixture
def site(workspace: Workspace, catalogue: Catalogue) -> Site:
    return Site(workspace, catalogue)


def test_file_that_left_the_folder_leaves_the_scene(site: Site, folder: Path) -> None:
    assert site.update(folder).imported == ["a", "b", "c"]
    assert site.drawn() == {"a", "b", "c"}
    (folder / "north" / "c.obj").unlink()
    summary = site.update(folder)
    assert (summary.imported, summary.unchanged, summary.removed) == ([], ["a", "b"], ["c"])
    assert site.drawn() == {"a", "b"}
    assert site.update(folder) == ImportSummary(unchanged=["a", "b"])


def test_renamed_file_is_not_drawn_twice(site: Site, folder: Path) -> None:
    site.update(folder)
    (folder / "a.obj").rename(folder / "z.obj")
    summary = site.update(folder)
    assert (summary.imported, summary.removed) == (["z"], ["a"])
    assert site.drawn() == {"b", "c", "z"}


def test_file_keeps_its_number_when_the_one_before_it_leaves(site: Site, folder: Path) -> None:
    (folder / "north" / "a.obj").write_text(house(200.0, 0.0, 6.0))
    assert site.update(folder).imported == ["a", "a-2", "b", "c"]
    (folder / "a.obj").unlink()
    summary = site.update(folder)
    assert (summary.imported, summary.removed) == ([], ["a"])
    assert site.drawn() == {"a-2", "b", "c"}


def test_changed_options_import_again(site: Site, folder: Path) -> None:
    site.update(folder)
    before = {asset.name: asset.digest for asset in site.catalogue.assets("town")}
    summary = site.update(folder, ImportOptions(up="y"))
    assert summary.imported == ["a", "b", "c"]
    assert reasons(summary.again) == {"of changed options: up (z → y)": ["a", "b", "c"]}
    assert all(asset.digest != before[asset.name] for asset in site.catalogue.assets("town"))
    assert site.update(folder, ImportOptions(up="y")).unchanged == ["a", "b", "c"]


def test_options_of_add_files_count_too(site: Site, folder: Path) -> None:
    site.catalogue.create_scene(SceneRecord("town"))
    for source in find_sources([folder]):
        import_file(site.workspace, site.catalogue, "town", source, ImportOptions(split="group"))
    assert reasons(site.update(folder).again) == {"of changed options: split (group → file)": ["a", "b", "c"]}


def test_changed_reader_imports_again(site: Site, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    site.update(folder)
    monkeypatch.setattr("map3d.formats.FORMATS", [replace(format, version=99) for format in FORMATS])
    assert site.update(folder).imported == ["a", "b", "c"]
    assert site.update(folder).unchanged == ["a", "b", "c"]


def test_assets_of_an_earlier_map3d_are_imported_again_once(site: Site, folder: Path) -> None:
    site.update(folder)
    for asset in site.catalogue.assets("town"):
        (source,) = find_sources([Path(asset.source)])
        site.catalogue.put_asset(replace(asset, source_digest=source_digest(source), report={"triangles": 12}))
    assert reasons(site.update(folder).again) == {"an earlier version of map3d did not record its options": ["a", "b", "c"]}
    assert site.update(folder).unchanged == ["a", "b", "c"]


def test_files_from_elsewhere_stay(site: Site, folder: Path, tmp_path: Path) -> None:
    site.update(folder)
    (tmp_path / "extra.obj").write_text(house(0.0, 80.0, 5.0))
    import_file(site.workspace, site.catalogue, "town", find_sources([tmp_path / "extra.obj"])[0], ImportOptions())
    summary = site.update(folder)
    assert (summary.removed, summary.elsewhere) == ([], ["extra"])
    assert site.drawn() == {"a", "b", "c", "extra"}


def test_a_folder_that_was_moved_still_loses_files(site: Site, folder: Path, tmp_path: Path) -> None:
    site.update(folder)
    moved = folder.rename(tmp_path / "moved")
    assert site.update(moved) == ImportSummary(unchanged=["a", "b", "c"])
    (moved / "a.obj").unlink()
    assert site.update(moved).removed == ["a"]


def test_broken_file_keeps_its_previous_asset(site: Site, folder: Path) -> None:
    site.update(folder)
    (folder / "a.obj").write_text("v 0 0 0\nv nan nan nan\nf 1 2 9\n")
    (folder / "north" / "b.obj").write_text("")
    summary = site.update(folder)
    assert [Path(path).name for path, _ in summary.failed] == ["b.obj", "a.obj"]
    assert summary.removed == []
    assert site.drawn() == {"a", "b", "c"}


# -- vanished disks -------------------------------------------------------------------------------------------------------------------


def empty(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.mkdir()


@pytest.mark.parametrize("part", [".", "north"])
def test_empty_folder_from_which_files_came_is_refused(site: Site, folder: Path, part: str) -> None:
    site.update(folder)
    empty(folder / part)
    with pytest.raises(BadRequest, match=r"perhaps a disk is not mounted.*--allow-empty"):
        site.update(folder)
    assert site.drawn() == {"a", "b", "c"}
    summary = site.update(folder, allow_empty=True)
    assert summary.removed == (["a", "b", "c"] if part == "." else ["b", "c"])


def test_subfolder_that_was_removed_is_believed(site: Site, folder: Path) -> None:
    site.update(folder)
    shutil.rmtree(folder / "north")
    assert site.update(folder).removed == ["b", "c"]


def test_emptied_scene_has_no_built_files(site: Site, folder: Path) -> None:
    site.update(folder)
    site.drawn()
    empty(folder)
    site.update(folder, allow_empty=True)
    left = {path.name for path in site.workspace.scene_folder("town").rglob("*") if path.is_file()}
    assert left == {".lock", "registry.sqlite", "removed-assets.json"}
    (folder / "d.obj").write_text(house(0.0, 0.0, 6.0))
    assert site.update(folder).imported == ["d"]
    assert site.drawn() == {"d"}


def test_folder_that_never_had_files_says_so(site: Site, tmp_path: Path) -> None:
    (tmp_path / "void").mkdir()
    with pytest.raises(BadRequest, match="no readable file in this folder"):
        site.update(tmp_path / "void", allow_empty=True)


def test_folder_that_cannot_be_read_is_refused(site: Site, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    site.update(folder)
    scandir = os.scandir

    def deny(path: str) -> object:
        if Path(path).name == "north":
            raise PermissionError(13, "Permission denied", path)
        return scandir(path)

    monkeypatch.setattr("os.scandir", deny)
    with pytest.raises(NotFound, match="north: cannot read the folder: Permission denied"):
        site.update(folder)
    monkeypatch.undo()
    assert site.drawn() == {"a", "b", "c"}


def test_nothing_is_removed_when_no_file_is_usable(site: Site, folder: Path) -> None:
    site.update(folder)
    shutil.rmtree(folder / "north")
    (folder / "a.obj").write_text("v 0 0 0\nv nan nan nan\nf 1 2 9\n")
    with pytest.raises(Map3dError, match=r"its only file is not usable: .*a\.obj: no usable triangle"):
        site.update(folder)
    assert site.drawn() == {"a", "b", "c"}
