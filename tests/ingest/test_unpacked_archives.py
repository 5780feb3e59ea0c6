"""Archives among the files of an import."""

from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import import_files
from map3d.errors import ImportFailed
from map3d.ingest.import_options import ImportOptions
from tests.operations.archives import write_zip

BOX = b"o box\nv 0 0 0\nv 2 0 0\nv 2 3 0\nf 1 2 3\n"


def test_archive_is_imported_like_a_folder_and_leaves_nothing(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path / "ws").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    archive = write_zip(tmp_path / "town.zip", {"a.obj": BOX, "deep/b.obj": BOX + b"# another\n", "bad.gml": b"no GML"})
    done = import_files(workspace, catalogue, "town", [archive], ImportOptions(crs="local"))
    assert sorted(item.asset for item in done.imported) == ["a", "b"]
    assert [path for path, _ in done.failed] == [f"{archive}/bad.gml"]
    outside = write_zip(tmp_path / "outside.zip", {"../a.obj": BOX})
    with pytest.raises(ImportFailed, match="outside the folder"):
        import_files(workspace, catalogue, "town", [outside], ImportOptions(crs="local"))
    assert not list((workspace.scene_folder("town") / "assets").glob(".*"))
    catalogue.close()
