"""A run from plan to manifest, with a planned scene and a subprocess that invents tiles."""

import dataclasses
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest
from pyproj import CRS

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import Catalogue, RenderingRecord, SceneCrs, SceneRecord, State, Workspace
from map3d.errors import BadRequest, OutsideFrame
from map3d.jobs.run import Run, RunPlan, RunResult
from map3d.jobs.run_settings import RunSettings
from map3d.jobs.timeouts import Timeouts
from map3d.lifecycle.create_rendering import add_layers, add_views
from map3d.renderings.manifest_writer import stored_occupancy, write_manifest
from map3d.renderings.plan import planned_occupancy
from map3d.requests import AddLayers
from map3d.tiles.block_versions import BlockVersions
from map3d.tiles.manifest import Manifest
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId, TileId, ViewAngles
from tests.renderings.scenes import SquareScene, rendering

CONTENT = {(0.05 + 0.1 * k, 0.05 + 0.1 * k): f"thing {k}" for k in range(10)}
SETTINGS = RunSettings(2, timeouts=Timeouts(heartbeat_s=0.5, block_s=10, idle_s=0.1, tick_s=0.05), entry="tests.jobs.faults:open_faulty")


@pytest.fixture
def workspace(tmp_path: Path, faults: Path) -> Workspace:
    return Workspace(tmp_path / "workspace").create()


@pytest.fixture
def catalogue(workspace: Workspace) -> Iterator[Catalogue]:
    opened = workspace.open_catalogue()
    crs = SceneCrs(25832, CRS.from_epsg(25832).to_wkt(), "ETRS89 / UTM zone 32N", "DHHN2016 height")
    opened.create_scene(SceneRecord("town", "A town", "© someone", crs, (691_000.0, 5_336_000.0, 500.0)))
    workspace.scene_folder("town").mkdir(parents=True)
    opened.create_rendering(rendering())
    yield opened
    opened.close()


def run_all(workspace: Workspace, catalogue: Catalogue, scene: SquareScene, stop_after: int | None = None) -> tuple[RunPlan, RunResult]:
    run = Run(workspace, catalogue, "r", SETTINGS)
    plan = run.plan(scene=scene)
    seen: list[object] = []

    def on_event(event: object) -> None:
        seen.append(event)
        if stop_after is not None and len(seen) == stop_after:
            run.stop.finish_jobs()

    return plan, run.work(plan, on_event)


def manifest(workspace: Workspace) -> Manifest:
    return Manifest.load(workspace.manifest_path("r").read_bytes())


def record(catalogue: Catalogue) -> RenderingRecord:
    return catalogue.rendering("r")


def test_manifest_describes_a_complete_run(workspace: Workspace, catalogue: Catalogue) -> None:
    plan, result = run_all(workspace, catalogue, SquareScene(CONTENT))
    assert (result.complete, result.stopped, result.open_jobs, result.quarantined_jobs) == (True, False, 0, 0)
    assert result.statistics.done == plan.open_jobs
    found = manifest(workspace)
    assert (found.complete, found.content_version, found.title, found.attribution) == (True, 1, "A town", "© someone")
    assert (found.crs.epsg, found.crs.vertical, found.origin) == (25832, "DHHN2016 height", (691_000.0, 5_336_000.0, 500.0))
    for view in found.views:
        with SqliteTileStore(workspace.store_path("r", view.frame.id), read_only=True) as store:
            assert view.occupancy == stored_occupancy(store)
            assert [(versions.common, versions.others) for versions in view.versions] == [(1, {})]


def from_stores(workspace: Workspace, catalogue: Catalogue) -> bytes:
    """Returns the manifest with occupancy and versions from the stores instead of the jobs."""
    views = []
    for view in manifest(workspace).views:
        occupancy, versions = view.occupancy, []
        for track in record(catalogue).tracks_of(view.frame):
            with SqliteTileStore(workspace.store_path("r", track.id), read_only=True) as store:
                occupancy = occupancy if track.number else stored_occupancy(store)
                versions.append(BlockVersions.of((block.id, block.version) for block in store.list_blocks()))
        views.append(dataclasses.replace(view, occupancy=occupancy, versions=tuple(versions)))
    return dataclasses.replace(manifest(workspace), views=tuple(views)).dump()


def test_manifest_from_the_jobs_equals_the_one_from_the_stores(workspace: Workspace, catalogue: Catalogue) -> None:
    for content in (CONTENT, {**CONTENT, (0.31, 0.9): "one more"}, dict(list(CONTENT.items())[2:])):
        run_all(workspace, catalogue, SquareScene(content))
        assert workspace.manifest_path("r").read_bytes() == from_stores(workspace, catalogue)
    add_layers(catalogue, "r", AddLayers(layers=("again=normal",)))
    run_all(workspace, catalogue, SquareScene(CONTENT))
    assert workspace.manifest_path("r").read_bytes() == from_stores(workspace, catalogue)


def test_a_complete_manifest_needs_no_store(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    before, box = workspace.manifest_path("r").read_bytes(), manifest(workspace).box
    for path in workspace.rendering_folder("r").iterdir():
        path.unlink()
    write_manifest(workspace, catalogue, "r", box)
    assert workspace.manifest_path("r").read_bytes() == before


def test_jobs_of_earlier_versions_have_their_occupancy_in_the_store(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    before, box = workspace.manifest_path("r").read_bytes(), manifest(workspace).box
    with sqlite3.connect(workspace.catalogue_path) as db:
        assert db.execute("UPDATE job SET occupied = NULL").rowcount > 0
    db.close()
    workspace.manifest_path("r").unlink()
    write_manifest(workspace, catalogue, "r", box)
    assert workspace.manifest_path("r").read_bytes() == before


def test_second_run_finds_no_jobs(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    before = workspace.manifest_path("r").read_bytes()
    plan, result = run_all(workspace, catalogue, SquareScene(CONTENT))
    assert (plan.open_jobs, plan.counts.added, plan.counts.changed, result.statistics.done) == (0, 0, 0, 0)
    assert workspace.manifest_path("r").read_bytes() == before


def test_change_renders_only_its_blocks_and_those_above(workspace: Workspace, catalogue: Catalogue) -> None:
    whole, _ = run_all(workspace, catalogue, SquareScene(CONTENT))
    changed = {**CONTENT, next(iter(CONTENT)): "another thing"}
    plan, result = run_all(workspace, catalogue, SquareScene(changed))
    views = len(record(catalogue).frames)
    levels = len({job.block.z for job in catalogue.jobs("r")})
    assert plan.counts.changed == result.statistics.done == views * levels < whole.open_jobs
    assert result.content_version == 2


def test_unchanged_bytes_keep_their_version(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    run_all(workspace, catalogue, SquareScene({**CONTENT, next(iter(CONTENT)): "another thing"}))
    assert manifest(workspace).content_version == 2
    assert all(view.versions[0] == BlockVersions(1) for view in manifest(workspace).views)


def stored(workspace: Workspace) -> dict[tuple[str, int, TileId], bytes | None]:
    """Returns every stored tile: (track, layer, tile) → bytes."""
    found = {}
    for path in workspace.rendering_folder("r").glob("*.sqlite"):
        with SqliteTileStore(path, read_only=True) as store:
            for layer in range(len(store.shape.layers)):
                found.update({(path.stem, layer, tile): store.get_tile(layer, *tile) for tile in store.list_tiles(layer)})
    return found


def test_added_layers_render_only_their_own_tracks(workspace: Workspace, catalogue: Catalogue) -> None:
    first, _ = run_all(workspace, catalogue, SquareScene(CONTENT))
    before, jobs = stored(workspace), {(job.track, job.block): job for job in catalogue.jobs("r")}
    add_layers(catalogue, "r", AddLayers(layers=("normal", "deep=depth")))
    plan, result = run_all(workspace, catalogue, SquareScene(CONTENT))
    assert (plan.counts.added, plan.counts.changed, plan.counts.kept) == (first.open_jobs, 0, first.open_jobs)
    assert (result.statistics.done, result.complete, result.content_version) == (first.open_jobs, True, 2)
    after = stored(workspace)
    assert {place: after[place] for place in before} == before
    assert {(job.track, job.block): job for job in catalogue.jobs("r") if "+" not in job.track} == jobs
    assert {track for track, _, _ in after.keys() - before.keys()} == {"0-45+1", "90-45+1"}
    found = manifest(workspace)
    assert [[layer.name for layer in layers] for layers in found.passes] == [["color", "id"], ["normal", "deep"]]
    for view in found.views:
        assert list(view.versions) == [BlockVersions(1), BlockVersions(2)]


def test_added_view_gets_every_pass(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    add_layers(catalogue, "r", AddLayers(layers=("normal",)))
    add_views(catalogue, "r", [ViewAngles(180, 45)])
    assert run_all(workspace, catalogue, SquareScene(CONTENT))[1].complete
    tracks = {job.track for job in catalogue.jobs("r")}
    assert tracks == {"0-45", "0-45+1", "90-45", "90-45+1", "180-45", "180-45+1"}
    assert tracks == {path.stem for path in workspace.rendering_folder("r").glob("*.sqlite")}
    assert [len(view.versions) for view in manifest(workspace).views] == [2, 2, 2]


def test_occupancy_stays_exact_until_added_layers_are_rendered(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    before = manifest(workspace)
    add_layers(catalogue, "r", AddLayers(layers=("normal",)))
    Run(workspace, catalogue, "r", SETTINGS).plan(scene=SquareScene(CONTENT))
    found = manifest(workspace)
    assert (found.complete, found.content_version) == (False, 2)
    assert [view.occupancy for view in found.views] == [view.occupancy for view in before.views]
    assert [view.versions[0] for view in found.views] == [view.versions[0] for view in before.views]


def test_change_renders_the_blocks_of_every_pass(workspace: Workspace, catalogue: Catalogue) -> None:
    add_layers(catalogue, "r", AddLayers(layers=("normal",)))
    run_all(workspace, catalogue, SquareScene(CONTENT))
    changed = {**CONTENT, next(iter(CONTENT)): "another thing"}
    plan, result = run_all(workspace, catalogue, SquareScene(changed))
    levels = len({job.block.z for job in catalogue.jobs("r")})
    assert plan.counts.changed == result.statistics.done == len(record(catalogue).tracks) * levels == 4 * levels


@pytest.mark.parametrize(
    "names", [("id",), ("color",), ("normal", "id"), ("x=normal", "x=depth"), ("normal", "other=normal"), ("moon",), ("=id",), ()]
)
def test_duplicate_or_unknown_layers_are_refused(catalogue: Catalogue, names: tuple[str, ...]) -> None:
    before = record(catalogue)
    with pytest.raises(BadRequest):
        add_layers(catalogue, "r", AddLayers(layers=names))
    assert record(catalogue) == before


def test_stopped_run_announces_open_tiles_and_can_be_resumed(workspace: Workspace, catalogue: Catalogue, faults: Path) -> None:
    (faults / "slow").write_text("0.1")
    scene = SquareScene(CONTENT)
    _, result = run_all(workspace, catalogue, scene, stop_after=3)
    assert result.stopped
    assert result.open_jobs > 0
    found = manifest(workspace)
    assert not found.complete
    for view in found.views:
        with SqliteTileStore(workspace.store_path("r", view.frame.id), read_only=True) as store:
            stored, planned = stored_occupancy(store), planned_occupancy(scene, view.frame)
        assert view.occupancy == view.occupancy | stored
        assert view.occupancy | planned == planned | stored
    (faults / "slow").unlink()
    _, result = run_all(workspace, catalogue, scene)
    assert result.complete
    assert manifest(workspace).complete
    assert manifest(workspace).content_version == 2, "clients may have seen the first version without these tiles"


def test_quarantined_block_leaves_the_rendering_incomplete(workspace: Workspace, catalogue: Catalogue, faults: Path) -> None:
    block = next(job.block for job in _planned(workspace, catalogue))
    (faults / f"{block.z}-{block.x}-{block.y}").write_text("exception")
    _, result = run_all(workspace, catalogue, SquareScene(CONTENT))
    assert not result.complete
    assert result.quarantined_jobs == len(record(catalogue).frames)
    assert not manifest(workspace).complete
    (faults / f"{block.z}-{block.x}-{block.y}").unlink()
    catalogue.retry("r")
    assert run_all(workspace, catalogue, SquareScene(CONTENT))[1].complete


def _planned(workspace: Workspace, catalogue: Catalogue) -> list[object]:
    Run(workspace, catalogue, "r", SETTINGS).plan(scene=SquareScene(CONTENT))
    return [job for job in catalogue.jobs("r") if job.kind == "base"]


def test_blocks_without_a_job_are_removed(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    view = record(catalogue).frames[0].id
    root = next(job.block.z for job in catalogue.jobs("r") if job.kind == "base")
    with SqliteTileStore(workspace.store_path("r", view)) as store:
        stray = BlockId(root, 0, 2**root - 1)
        store.put_block(stray, "old", 1, [], None)
        run_all(workspace, catalogue, SquareScene(CONTENT))
        assert store.get_block(stray) is None
        assert len(store.list_blocks()) == len(list(catalogue.jobs("r", view)))


def test_content_outside_the_frame_stops_before_any_change(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    far = SquareScene(CONTENT, box=((0.0, 0.0, 0.0), (900.0, 100.0, 10.0)))
    with pytest.raises(OutsideFrame, match="--regrid"):
        Run(workspace, catalogue, "r", SETTINGS).plan(scene=far)
    assert catalogue.count_jobs("r")[State.DONE] == len(list(catalogue.jobs("r")))


def test_workers_share_memory_and_too_little_is_refused() -> None:
    assert RunSettings(2).cache_bytes == 512 << 20
    assert RunSettings(2, 2 << 30).cache_bytes == (1 << 30) - (256 << 20)
    with pytest.raises(BadRequest, match="500 MiB is too small for 2 workers: give at least 640 MiB"):
        dataclasses.replace(RunSettings(2), max_memory_bytes=500 << 20).check()
    with pytest.raises(BadRequest, match="too small for 1 worker: "):
        RunSettings(1, 256 << 20).check()
