"""A scene that is rebuilt while it is being rendered: no block has pixels of another scene than that of its key."""

from pathlib import Path

import pytest

from map3d.catalogue import Catalogue, Lease, Workspace
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import import_file
from map3d.ingest.sources import find_sources
from map3d.jobs.events import RunEvent, SceneChanged
from map3d.jobs.run import Run as RenderRun
from map3d.jobs.run_settings import RunSettings
from map3d.renderings.render_task import RenderTask
from map3d.scenes.build import BUILD_BYTES, build
from map3d.subprocess import Message
from tests.cli.test_incremental import render_from_scratch
from tests.cli.test_whole import digest
from tests.cli.towns import Run, house, write_town

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole

LEASES_BEFORE_THE_CHANGE = 3


@pytest.fixture
def town(run: Run, tmp_path: Path) -> Workspace:
    """The scene `town` with an empty rendering `view`."""
    assert run("create-scene", "town")[0] == 0
    assert run("add-files", "town", str(write_town(tmp_path / "files")))[0] == 0
    assert run("create-rendering", "town", "view", "--res", "0.03", "--view", "0/45")[0] == 0
    return Workspace(tmp_path / "workspace")


def raise_houses(workspace: Workspace, catalogue: Catalogue, files: Path) -> None:
    """Raises the southernmost houses, which the first blocks do not show, and builds the scene again."""
    for path in sorted(files.glob("house-*-0.obj")):
        path.write_text(house(40.0 * int(path.stem.split("-")[1]), 0.0, 18.0))
        import_file(workspace, catalogue, "town", find_sources([path])[0], ImportOptions())
    build(workspace, catalogue, "town", threads=1, max_memory_bytes=BUILD_BYTES)


@pytest.mark.parametrize("is_planned", [True, False], ids=["planned by another run", "not planned"])
def test_every_block_equals_a_fresh_render(run: Run, town: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_planned: bool) -> None:
    catalogue = town.open_catalogue()
    build(town, catalogue, "town", threads=1, max_memory_bytes=BUILD_BYTES)
    rendering = RenderRun(town, catalogue, "view", RunSettings(1))
    events: list[RunEvent] = []
    make_request = RenderTask.request
    leases: list[Lease] = []

    def request(task: RenderTask, lease: Lease) -> Message:
        """Changes the scene in the middle of the render, while the worker waits."""
        leases.append(lease)
        if len(leases) == LEASES_BEFORE_THE_CHANGE:
            raise_houses(town, catalogue, tmp_path / "files")
            if is_planned:
                RenderRun(town, catalogue, "view", RunSettings(1)).plan()
        return make_request(task, lease)

    monkeypatch.setattr(RenderTask, "request", request)
    result = rendering.work(rendering.plan(), events.append)
    assert result.complete
    assert (result.statistics.failed_attempts, result.statistics.exit_reasons) == (0, [])
    assert is_planned != any(isinstance(event, SceneChanged) for event in events)
    assert all(job.attempts == 1 for job in catalogue.jobs("view"))
    catalogue.close()
    assert digest(town) == render_from_scratch(run, town, monkeypatch)
