import shutil
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.tiles import viewer_files
from tests.web.workspaces import make_workspace


@pytest.fixture(autouse=True)
def built_viewer(tmp_path, monkeypatch):
    """Replaces the viewer's files, which may not be built."""
    folder = tmp_path / "package" / "viewer"
    (folder / "assets").mkdir(parents=True)
    (folder / "index.html").write_text("<!doctype html><script src=map3d.js></script>")
    (folder / "assets" / "worker.js").write_text("// worker")
    (folder / "map3d.d.ts").write_text("for authors of pages")
    (folder / ".shots").mkdir()
    (folder / ".shots" / "x.png").write_text("not the viewer's")
    monkeypatch.setattr(viewer_files, "files", lambda _: folder.parent)
    return folder


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """A workspace for read-only tests."""
    return make_workspace(tmp_path_factory.mktemp("finished") / "ws")


@pytest.fixture
def workspace(finished, tmp_path):
    return Workspace(Path(shutil.copytree(finished.root, tmp_path / "ws")))


@pytest.fixture
def out(tmp_path):
    return tmp_path / "public"
