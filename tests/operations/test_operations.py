"""What operations do, and which requests for them are refused."""

from pathlib import Path
from uuid import uuid4

import pytest
from pymongo import MongoClient

from map3d.catalogue import OperationState
from map3d.errors import BadRequest, NotFound
from map3d.messages import message, table
from map3d.operations.arguments import ARGUMENTS
from map3d.operations.do_operation import DO
from map3d.operations.uploaded_files import IMPORT_FOLDERS, check_host_path
from map3d.scenes.build import build
from tests.cli.towns import write_town
from tests.operations.scenario import Scenario, open_scenario, published, run_all

DONE, FAILED = OperationState.DONE, OperationState.FAILED


def test_every_kind_has_arguments_and_a_function() -> None:
    from map3d.catalogue.operation_records import OPERATION_KINDS

    assert tuple(ARGUMENTS) == tuple(DO) == OPERATION_KINDS


def test_zip_with_textures_is_imported_built_rendered_published_and_removed(scenario: Scenario, archive: Path) -> None:
    run_all(scenario, archive)
    assets = {asset.name: asset for asset in scenario.catalogue.assets("town")}
    assert sorted(assets) == ["house-1", "house-2", "house-3", "textured"]
    assert list(scenario.workspace.asset_folder("town", "textured").glob("textures/*.png")), "the texture was found beside its document"
    assert (scenario.workspace.root / "published" / "town" / "index.html").is_file()
    imported = scenario.catalogue.operations()[-1]
    assert imported.message == message("imported-of-files", files=4, unchanged=0, used=2, ignored=0)
    assert "house-1: 1 object, 12 triangles" in scenario.log(imported)
    removed = scenario.do("remove", what="files", names=["house-1"])
    assert (removed.state, removed.message) == (DONE, message("files-removed", files=1, scene="town"))
    assert len(scenario.catalogue.assets("town")) == 3
    assert scenario.do("render").state is DONE
    assert str(scenario.do("publish").message).endswith("removed")
    with pytest.raises(BadRequest, match=r"rendering town: is published in published/town; list in folders"):
        scenario.ask("remove", what="rendering")
    with pytest.raises(NotFound, match="no published folder other"):
        scenario.ask("remove", what="rendering", folders=["town", "other"])
    removed = scenario.do("remove", what="rendering", folders=["town"])
    assert (removed.state, str(removed.message).partition(", ")[0]) == (DONE, "removed rendering town with published/town")
    assert list((scenario.workspace.root / "published").iterdir()) == []
    assert scenario.do("remove", what="scene").state is DONE
    assert scenario.catalogue.scenes() == []


def test_operations_in_mongodb_lead_to_the_same_bytes(mongo_server: str, tmp_path: Path, archive: Path, undisturbed: dict[str, bytes]) -> None:
    name = f"test_{uuid4().hex[:12]}"
    scenario = open_scenario(tmp_path / "ws", f"{mongo_server}/{name}")
    try:
        run_all(scenario, archive)
        assert published(scenario) == undisturbed
    finally:
        scenario.catalogue.close()
        with MongoClient[dict[str, object]](mongo_server) as client:
            client.drop_database(name)


def test_files_of_one_import_find_each_other(scenario: Scenario, tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl red\nv 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n")
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    ended = scenario.do("import", files=[scenario.upload(tmp_path / name) for name in ("a.obj", "a.mtl")])
    assert ended.state is DONE
    materials = (scenario.workspace.asset_folder("town", "a") / "materials.json").read_text()
    assert "red" in materials


def test_broken_file_fails_the_import_after_the_others_are_imported(scenario: Scenario, tmp_path: Path) -> None:
    files = [*sorted(write_town(tmp_path / "town", 1).iterdir()), tmp_path / "bad.obj"]
    files[1].write_text("v 0 0 0\nf 1 1 1\n")
    ended = scenario.do("import", files=[scenario.upload(path) for path in files])
    assert ended.state is FAILED
    assert "imported 1 file, 0 unchanged, 1 failed" in str(ended.message)
    assert "bad.obj" in scenario.log(ended)
    assert [asset.name for asset in scenario.catalogue.assets("town")] == ["house-0-0"]
    again = scenario.catalogue.retry_operation(ended.id)
    scenario.work()
    assert "imported 0 files, 1 unchanged, 1 failed" in str(scenario.catalogue.operation(again.id).message), "uploads stay until all are imported"


def test_damaged_archive_fails_the_import(scenario: Scenario, tmp_path: Path) -> None:
    (tmp_path / "bad.zip").write_bytes(b"PK\x03\x04 no archive")
    ended = scenario.do("import", files=[scenario.upload(tmp_path / "bad.zip")])
    assert (ended.state, "bad.zip: cannot be unpacked" in str(ended.message)) == (FAILED, True)


def test_two_uploads_with_one_name_are_refused(scenario: Scenario, tmp_path: Path) -> None:
    path = next(write_town(tmp_path / "town", 1).iterdir())
    ended = scenario.do("import", files=[scenario.upload(path), scenario.upload(path)])
    assert (ended.state, ended.message) == (FAILED, message("upload-name-taken", file=path.name))


def test_every_count_and_stage_of_a_build_has_a_text(scenario: Scenario, tmp_path: Path) -> None:
    path = next(write_town(tmp_path / "town", 1).iterdir())
    scenario.do("import", files=[scenario.upload(path)])
    stages = set()

    def progress(stage: str, _done: int, _total: int) -> bool:
        stages.add(stage)
        return True

    report = build(scenario.workspace, scenario.catalogue, "town", threads=1, max_memory_bytes=1 << 30, progress=progress)
    counts = {name for name, count in report.items() if isinstance(count, int)}
    assert (len(counts) > 15, "chunks" in stages) == (True, True)
    assert {*(f"built-{name.replace('_', '-')}" for name in counts), *(f"building-{stage}" for stage in stages)} <= set(table())


def test_asset_gets_the_given_name(scenario: Scenario, tmp_path: Path) -> None:
    path = next(write_town(tmp_path / "town", 1).iterdir())
    ended = scenario.do("import", files=[scenario.upload(path)], options={"name": "hut", "up": "z"})
    assert (ended.state, [asset.name for asset in scenario.catalogue.assets("town")]) == (DONE, ["hut"])


def test_incomplete_and_unknown_uploads_are_refused(scenario: Scenario, tmp_path: Path) -> None:
    path = next(write_town(tmp_path / "town", 1).iterdir())
    id = scenario.upload(path)
    data = scenario.workspace.root / "uploads" / id / "data"
    data.write_bytes(data.read_bytes()[:-1])
    with pytest.raises(BadRequest, match="bytes have arrived; resume the upload first"):
        scenario.ask("import", files=[id])
    for unknown in ("two", "../one", "", ".operation-1", "a" * 65, "ö"):
        with pytest.raises(NotFound, match="no upload"):
            scenario.ask("import", files=[unknown])
    assert scenario.catalogue.operations() == []


def test_folders_of_uploads_are_kept(scenario: Scenario, tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("mtllib lib/a.mtl\nusemtl red\nv 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n")
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    ids = [scenario.upload(tmp_path / "a.obj", "town/a.obj"), scenario.upload(tmp_path / "a.mtl", "town/lib/a.mtl")]
    assert scenario.do("import", files=ids).state is DONE
    assert "red" in (scenario.workspace.asset_folder("town", "a") / "materials.json").read_text()


def test_uploads_of_another_user_are_not_found(scenario: Scenario, tmp_path: Path) -> None:
    path = next(write_town(tmp_path / "town", 1).iterdir())
    with pytest.raises(NotFound, match="no upload"):
        scenario.ask("import", files=[scenario.upload(path, user="bob")])


def test_files_of_the_host_are_imported_only_from_allowed_folders(scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_town(tmp_path / "data" / "town", 1)
    (tmp_path / "secret.obj").write_text("v 0 0 0\n")
    (folder / "link.obj").symlink_to(tmp_path / "secret.obj")
    with pytest.raises(BadRequest, match=IMPORT_FOLDERS):
        scenario.ask("import", paths=[str(folder)])
    monkeypatch.setenv(IMPORT_FOLDERS, str(tmp_path / "data"))
    for path in ("secret.obj", "data/../secret.obj", "data/town/link.obj", "data2"):
        with pytest.raises(BadRequest, match="outside the folders"):
            check_host_path(str(tmp_path / path))
    with pytest.raises(NotFound):
        check_host_path(str(tmp_path / "data" / "none.obj"))
    (folder / "link.obj").unlink()
    assert scenario.do("import", paths=[str(folder)]).state is DONE


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [
        ("import", {}),
        ("import", {"files": []}),
        ("import", {"files": "one"}),
        ("import", {"paths": [1]}),
        ("import", {"options": {}}),
        ("import", {"files": ["a"], "options": {"up": "x"}}),
        ("import", {"files": ["a"], "options": {"unknown": 1}}),
        ("build", {"workers": 0}),
        ("build", {"workers": True}),
        ("build", {"workers": 513}),
        ("render", {"max_memory_bytes": 0.5}),
        ("publish", {"folder": "../out"}),
        ("publish", {"folder": "/tmp/out"}),
        ("publish", {"out": "x"}),
        ("remove", {}),
        ("remove", {"what": "all"}),
        ("remove", {"what": "files"}),
        ("remove", {"what": "scene", "names": ["a"]}),
        ("remove", {"what": "published"}),
        ("remove", {"what": "published", "folder": "../out"}),
        ("remove", {"what": "rendering", "folder": "town"}),
        ("remove", {"what": "rendering", "folders": ["../out"]}),
        ("remove", {"what": "files", "names": ["a"], "folders": []}),
        ("destroy", {}),
    ],
)
def test_wrong_arguments_are_refused(scenario: Scenario, kind: str, arguments: dict[str, object]) -> None:
    with pytest.raises(BadRequest, match=f"operation '?{kind}"):
        scenario.ask(kind, **arguments)
    assert scenario.catalogue.operations() == []


def test_removal_of_unknown_files_and_of_a_scene_in_use_is_refused(scenario: Scenario, tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="no asset nothing"):
        scenario.ask("remove", what="files", names=["nothing"])
    with pytest.raises(NotFound):
        scenario.ask("remove", "nowhere", what="scene")
    path = next(write_town(tmp_path / "town", 1).iterdir())
    scenario.do("import", files=[scenario.upload(path)])
    scenario.do("build")
    scenario.create_rendering()
    with pytest.raises(BadRequest, match="has renderings"):
        scenario.ask("remove", what="scene")
