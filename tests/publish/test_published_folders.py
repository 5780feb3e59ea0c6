"""The workspace's published folders: listed by rendering, and removed inside `published/` alone."""

import re
import shutil

import pytest

from map3d.errors import BadRequest, NotFound
from map3d.publish import publish, published_folders
from map3d.publish.published_folders import find_published, remove_published, remove_with_renderings
from map3d.tiles.manifest import FILE_NAME


@pytest.fixture
def root(workspace):
    """`published/`, with the rendering `tea` in the folders `first` and `second`."""
    root = workspace.root / "published"
    root.mkdir()
    for name in ("first", "second"):
        publish(workspace, "tea", root / name)
    return root


def names(workspace, rendering="tea"):
    return [folder.name for folder in published_folders.published_folders(workspace, rendering)]


def test_folders_are_listed_by_rendering(workspace, root):
    manifest = (root / "first" / FILE_NAME).read_text()
    shutil.copytree(root / "first", root / "coffee")
    (root / "coffee" / FILE_NAME).write_text(manifest.replace('"tea"', '"coffee"'))
    (root / "broken").mkdir()
    (root / "broken" / FILE_NAME).write_text("{")
    (root / "Notes").mkdir()
    (root / "linked").symlink_to(root / "first")
    assert (names(workspace), names(workspace, "coffee"), names(workspace, "milk")) == (["first", "second"], ["coffee"], [])
    first = find_published(workspace, "tea", "first")
    assert first.bytes == sum(path.stat().st_size for path in (root / "first").rglob("*") if path.is_file())


def test_nothing_is_published_without_the_folder(workspace):
    assert names(workspace) == []
    with pytest.raises(NotFound, match="no published folder first"):
        remove_published(workspace, "tea", "first")


def test_one_folder_is_removed_with_its_drafts(workspace, root):
    for draft in (".first.publishing", ".first.old"):
        shutil.copytree(root / "first", root / draft)
    assert remove_published(workspace, "tea", "first") > 0
    assert sorted(path.name for path in root.iterdir()) == ["second"]
    with pytest.raises(NotFound):
        remove_published(workspace, "tea", "first")


def test_folders_go_with_their_rendering_and_others_stay(workspace, root):
    assert [folder.name for folder in published_folders.folders_of(workspace, ["milk", "tea"])] == ["first", "second"]
    assert remove_with_renderings(workspace, ["milk", "tea"], ["second", "gone"]) > 0
    assert remove_with_renderings(workspace, ["milk", "tea"], ["second", "gone"]) == 0, "a repetition finds nothing left"
    assert names(workspace) == ["first"]
    with pytest.raises(BadRequest, match="holds rendering tea, not milk"):
        remove_with_renderings(workspace, ["milk"], ["first"])
    assert remove_with_renderings(workspace, [], ["first"]) == 0
    assert names(workspace) == ["first"]


@pytest.mark.parametrize("name", ["", ".", "..", "../ws", "first/..", "/etc", "first\n", "First", ".first.old", "é", "a" * 65])
def test_other_names_are_refused(workspace, root, name):
    with pytest.raises(BadRequest, match="lower-case"):
        remove_published(workspace, "tea", name)
    assert names(workspace) == ["first", "second"]


def test_links_are_not_followed(workspace, root, tmp_path):
    outside = tmp_path / "outside"
    shutil.copytree(root / "first", outside)
    (root / "linked").symlink_to(outside)
    with pytest.raises(NotFound):
        remove_published(workspace, "tea", "linked")
    assert (outside / FILE_NAME).is_file()


@pytest.mark.parametrize(("content", "says"), [(None, "holds no rendering"), ("{}", "holds no rendering"), ("coffee", "holds rendering coffee")])
def test_folders_of_others_stay(workspace, root, content, says):
    manifest = root / "first" / FILE_NAME
    if content is None:
        manifest.unlink()
    else:
        manifest.write_text(re.sub('"name": ?"tea"', '"name": "coffee"', manifest.read_text()) if content == "coffee" else content)
    with pytest.raises(BadRequest, match=says):
        remove_published(workspace, "tea", "first")
    assert (root / "first").is_dir()


def test_killed_removal_is_completed(workspace, root, monkeypatch):
    def die(folder):
        if folder.exists():
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(published_folders, "remove_folder", die)
        with pytest.raises(KeyboardInterrupt):
            remove_published(workspace, "tea", "first")
    assert names(workspace) == ["second"], "nothing serves the folder any more"
    assert remove_published(workspace, "tea", "first") > 0
    assert sorted(path.name for path in root.iterdir()) == ["second"]


def test_folder_is_published_again_after_a_killed_removal(workspace, root):
    (root / "first").rename(root / ".first.removing")
    publish(workspace, "tea", root / "first")
    remove_published(workspace, "tea", "first")
    assert sorted(path.name for path in root.iterdir()) == ["second"]
