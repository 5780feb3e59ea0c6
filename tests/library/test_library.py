"""The Python library: the same results as the command line, typed errors, nothing printed."""

import subprocess
import sys
from pathlib import Path

import pytest

import map3d
from map3d.cli import app
from map3d.errors import AlreadyExists, BadName, BadRequest, NotFound, UnknownFormat
from map3d.library import LibraryWorkspace
from tests.cli.towns import write_town


@pytest.fixture
def files(tmp_path: Path) -> Path:
    return write_town(tmp_path / "files", 2)


def open_(tmp_path: Path) -> LibraryWorkspace:
    opened: LibraryWorkspace = map3d.open_workspace(tmp_path / "library")
    return opened


def tree(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_library_and_command_line_publish_the_same_bytes(tmp_path: Path, files: Path, capfd: pytest.CaptureFixture[str]) -> None:
    where = ["-w", str(tmp_path / "cli")]
    for arguments in (
        ["create-scene", "town", "--title", "T"],
        ["add-files", "town", str(files)],
        ["create-rendering", "town", "town", "--view", "0-45", "--res", "0.2", "--layers", "color,id", "--color", "png"],
        ["render", "town", "--workers", "1"],
        ["publish", "town", "-o", str(tmp_path / "by-cli")],
    ):
        assert app.run([*arguments, *where]) == 0
    capfd.readouterr()
    stages = set()
    with open_(tmp_path) as workspace:
        scene = workspace.create_scene("town", title="T")
        report = scene.add_files(files, progress=lambda stage, *_: stages.add(stage.split(" ")[0]))
        assert ([item.asset for item in report.imported], report.failed) == ([asset.name for asset in scene.files], [])
        assert sum(item.triangles for item in report.imported) == 48
        rendering = scene.create_rendering("town", views=[(0, 45)], res_m=0.2, layers=["color", "id"], color="png")
        assert rendering.estimate(workers=1).open_tiles > 0
        steps: list[tuple[str, int, int]] = []
        result = rendering.render(workers=1, progress=lambda *step: steps.append(step))
        assert (result.complete, result.stopped, result.quarantined_jobs) == (True, False, 0)
        assert steps[-1] == ("rendering", result.statistics.done, result.statistics.done)
        assert rendering.progress().is_complete
        assert rendering.estimate(workers=1).open_tiles == 0
        published = rendering.publish(tmp_path / "by-library", progress=lambda stage, *_: stages.add(stage.split(" ")[0]))
        assert published.archives == 2
    assert tree(tmp_path / "by-library") == tree(tmp_path / "by-cli")
    assert stages == {"importing", "publishing"}
    assert capfd.readouterr() == ("", "")


def test_scenes_and_renderings_are_listed_found_and_removed(tmp_path: Path, files: Path) -> None:
    with open_(tmp_path) as workspace:
        scene = workspace.create_scene("town")
        assert [(one.name, one.record.title) for one in workspace.scenes()] == [("town", "")]
        scene.add_files(files / "house-0-0.obj", name="hut")
        scene.add_files(files / "house-1-1.obj")
        assert [asset.name for asset in scene.files] == ["house-1-1", "hut"]
        assert scene.add_files(files / "house-1-1.obj", skip_unchanged=True).unchanged == ["house-1-1"]
        built = scene.build()
        assert built is not None
        assert built["triangles_read"] == 24
        assert scene.build() is None
        rendering = scene.create_rendering("town", directions=2, pitch=30, levels=2)
        assert [frame.id for frame in rendering.record.frames] == ["0-30", "180-30"]
        rendering.add_views((90, 45))
        rendering.add_layers("noon=picture", sun=(195, 60))
        assert [layer.name for layer in rendering.record.layers] == ["color", "data", "noon"]
        assert [one.name for one in scene.renderings()] == [one.name for one in workspace.renderings()] == ["town"]
        assert scene.remove_files("hut") == ["hut"]
        assert scene.build() is None, "it was built again"
        with pytest.raises(BadRequest, match="has renderings"):
            scene.remove()
        workspace.rendering("town").remove()
        assert workspace.renderings() == []
        scene.remove()
        assert workspace.scenes() == []
        assert repr(workspace) == f"<map3d workspace {str(tmp_path / 'library')!r}>"


def test_errors_are_typed(tmp_path: Path, files: Path) -> None:
    with pytest.raises(NotFound):
        map3d.open_workspace(tmp_path / "nowhere", create=False)
    assert issubclass(NotFound, map3d.Map3dError)
    (tmp_path / "text.txt").write_text("hello")
    with open_(tmp_path) as workspace:
        scene = workspace.create_scene("town")
        for error, call in (
            (AlreadyExists, lambda: workspace.create_scene("town")),
            (BadName, lambda: workspace.create_scene("No Name")),
            (BadRequest, lambda: workspace.create_scene("other", ground_plane="maybe")),
            (NotFound, lambda: workspace.scene("other")),
            (NotFound, lambda: workspace.rendering("other")),
            (NotFound, lambda: scene.add_files(tmp_path / "none.obj")),
            (UnknownFormat, lambda: scene.add_files(tmp_path / "text.txt")),
            (BadRequest, scene.build),
            (BadRequest, lambda: scene.create_rendering("r", views=[(0, 91)], res_m=1)),
            (BadRequest, lambda: scene.create_rendering("r", views=["north"], res_m=1)),
            (BadRequest, lambda: scene.create_rendering("r", views=[(0, 45)], directions=4, res_m=1)),
            (BadRequest, lambda: scene.create_rendering("r")),
        ):
            with pytest.raises(error):
                call()
        assert workspace.scenes()[0].files == []


def test_import_of_map3d_loads_nothing_else() -> None:
    program = (
        "import sys, map3d; print(*(name for name in sys.modules if name.startswith('map3d') or name in ('numpy', 'click', 'flask', 'sqlite3')))"
    )
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    assert loaded == ["map3d"]
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = map3d.nothing
    assert {"open_workspace", "Map3dError", "__version__"} <= set(dir(map3d))
