"""A run from plan to manifest, on a scene that is only a plan and a child that makes up tiles."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import pytest
from pyproj import CRS

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import Catalogue, RenderingRecord, SceneCrs, SceneRecord, State, Workspace
from map3d.errors import BadRequest, OutsideFrame
from map3d.jobs.run import Outcome, Plan, Run, Settings
from map3d.jobs.timeouts import Terms
from map3d.renderings.create import add_layers, add_views
from map3d.renderings.layers import LayerRequest
from map3d.renderings.manifest_writer import stored_occupancy
from map3d.tiles.manifest import Manifest
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId, TileId, ViewAngles
from tests.renderings.scenes import SquareScene, rendering

CONTENT = {(0.05 + 0.1 * k, 0.05 + 0.1 * k): f"thing {k}" for k in range(10)}
SETTINGS = Settings(2, terms=Terms(heartbeat_s=0.5, block_s=10, idle_s=0.1, tick_s=0.05), entry="tests.jobs.faults:open_work")


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


def run_all(workspace: Workspace, catalogue: Catalogue, scene: SquareScene, stop_after: int | None = None) -> tuple[Plan, Outcome]:
    run = Run(workspace, catalogue, "r", SETTINGS)
    plan = run.plan(scene=scene)
    seen: list[object] = []

    def on_event(event: object) -> None:
        seen.append(event)
        if stop_after is not None and len(seen) == stop_after:
            run.stop()

    return plan, run.work(plan, on_event)


def manifest(workspace: Workspace) -> Manifest:
    return Manifest.load(workspace.manifest_path("r").read_bytes())


def record(catalogue: Catalogue) -> RenderingRecord:
    return catalogue.rendering("r")


def test_a_whole_run_is_told_by_the_manifest(workspace: Workspace, catalogue: Catalogue) -> None:
    plan, outcome = run_all(workspace, catalogue, SquareScene(CONTENT))
    assert (outcome.complete, outcome.stopped, outcome.open_jobs, outcome.quarantined_jobs) == (True, False, 0, 0)
    assert outcome.tally.done == plan.open_jobs
    told = manifest(workspace)
    assert (told.complete, told.content_version, told.title, told.attribution) == (True, 1, "A town", "© someone")
    assert (told.crs.epsg, told.crs.vertical, told.origin) == (25832, "DHHN2016 height", (691_000.0, 5_336_000.0, 500.0))
    for view in told.views:
        with SqliteTileStore(workspace.store_path("r", view.frame.id), read_only=True) as store:
            assert view.occupancy == stored_occupancy(store)
            assert [set(versions.values()) for versions in view.versions] == [{1}]


def test_a_second_run_finds_nothing_to_do(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    before = workspace.manifest_path("r").read_bytes()
    plan, outcome = run_all(workspace, catalogue, SquareScene(CONTENT))
    assert (plan.open_jobs, plan.outcome.added, plan.outcome.changed, outcome.tally.done) == (0, 0, 0, 0)
    assert workspace.manifest_path("r").read_bytes() == before


def test_a_change_renders_its_blocks_and_those_above_only(workspace: Workspace, catalogue: Catalogue) -> None:
    whole, _ = run_all(workspace, catalogue, SquareScene(CONTENT))
    changed = {**CONTENT, next(iter(CONTENT)): "another thing"}
    plan, outcome = run_all(workspace, catalogue, SquareScene(changed))
    views = len(record(catalogue).frames)
    levels = len({job.block.z for job in catalogue.jobs("r")})
    assert plan.outcome.changed == outcome.tally.done == views * levels < whole.open_jobs
    assert outcome.content_version == 2


def test_bytes_that_stay_the_same_keep_their_version(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    run_all(workspace, catalogue, SquareScene({**CONTENT, next(iter(CONTENT)): "another thing"}))
    assert manifest(workspace).content_version == 2
    assert {version for view in manifest(workspace).views for version in view.versions[0].values()} == {1}


def stored(workspace: Workspace) -> dict[tuple[str, int, TileId], bytes | None]:
    """Every tile in the stores: (track, layer, tile) → bytes."""
    found = {}
    for path in workspace.rendering_folder("r").glob("*.sqlite"):
        with SqliteTileStore(path, read_only=True) as store:
            for layer in range(len(store.shape.layers)):
                found.update({(path.stem, layer, tile): store.get_tile(layer, *tile) for tile in store.list_tiles(layer)})
    return found


def test_added_layers_render_tracks_of_their_own_only(workspace: Workspace, catalogue: Catalogue) -> None:
    first, _ = run_all(workspace, catalogue, SquareScene(CONTENT))
    before, jobs = stored(workspace), {(job.track, job.block): job for job in catalogue.jobs("r")}
    add_layers(catalogue, "r", LayerRequest(("normal", "deep=depth")))
    plan, outcome = run_all(workspace, catalogue, SquareScene(CONTENT))
    assert (plan.outcome.added, plan.outcome.changed, plan.outcome.kept) == (first.open_jobs, 0, first.open_jobs)
    assert (outcome.tally.done, outcome.complete, outcome.content_version) == (first.open_jobs, True, 2)
    after = stored(workspace)
    assert {place: after[place] for place in before} == before
    assert {(job.track, job.block): job for job in catalogue.jobs("r") if "+" not in job.track} == jobs
    assert {track for track, _, _ in after.keys() - before.keys()} == {"0-45+1", "90-45+1"}
    told = manifest(workspace)
    assert [[layer.name for layer in layers] for layers in told.passes] == [["color", "id"], ["normal", "deep"]]
    for view in told.views:
        assert [set(versions.values()) for versions in view.versions] == [{1}, {2}]


def test_a_view_that_joins_later_gets_every_pass(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    add_layers(catalogue, "r", LayerRequest(("normal",)))
    add_views(catalogue, "r", [ViewAngles(180, 45)])
    assert run_all(workspace, catalogue, SquareScene(CONTENT))[1].complete
    tracks = {job.track for job in catalogue.jobs("r")}
    assert tracks == {"0-45", "0-45+1", "90-45", "90-45+1", "180-45", "180-45+1"}
    assert tracks == {path.stem for path in workspace.rendering_folder("r").glob("*.sqlite")}
    assert [len(view.versions) for view in manifest(workspace).views] == [2, 2, 2]


def test_occupancy_stays_exact_while_added_layers_are_to_come(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    before = manifest(workspace)
    add_layers(catalogue, "r", LayerRequest(("normal",)))
    Run(workspace, catalogue, "r", SETTINGS).plan(scene=SquareScene(CONTENT))
    told = manifest(workspace)
    assert (told.complete, told.content_version) == (False, 2)
    assert [view.occupancy for view in told.views] == [view.occupancy for view in before.views]
    assert [view.versions[0] for view in told.views] == [view.versions[0] for view in before.views]


def test_a_change_renders_the_blocks_of_every_pass(workspace: Workspace, catalogue: Catalogue) -> None:
    add_layers(catalogue, "r", LayerRequest(("normal",)))
    run_all(workspace, catalogue, SquareScene(CONTENT))
    changed = {**CONTENT, next(iter(CONTENT)): "another thing"}
    plan, outcome = run_all(workspace, catalogue, SquareScene(changed))
    levels = len({job.block.z for job in catalogue.jobs("r")})
    assert plan.outcome.changed == outcome.tally.done == len(record(catalogue).tracks) * levels == 4 * levels


@pytest.mark.parametrize(
    "names", [("id",), ("color",), ("normal", "id"), ("x=normal", "x=depth"), ("normal", "other=normal"), ("moon",), ("=id",), ()]
)
def test_layers_that_are_there_or_make_no_sense_are_refused(catalogue: Catalogue, names: tuple[str, ...]) -> None:
    before = record(catalogue)
    with pytest.raises(BadRequest):
        add_layers(catalogue, "r", LayerRequest(names))
    assert record(catalogue) == before


def test_a_stopped_run_tells_what_may_still_come_and_is_taken_up(workspace: Workspace, catalogue: Catalogue, faults: Path) -> None:
    (faults / "slow").write_text("0.1")
    scene = SquareScene(CONTENT)
    _, outcome = run_all(workspace, catalogue, scene, stop_after=3)
    assert outcome.stopped
    assert outcome.open_jobs > 0
    told = manifest(workspace)
    assert not told.complete
    for view in told.views:
        with SqliteTileStore(workspace.store_path("r", view.frame.id), read_only=True) as store:
            assert view.occupancy == view.occupancy | stored_occupancy(store)
        zmax = view.frame.zmax
        planned = scene.occupied("", zmax)
        assert all(tile in view.occupancy or planned[tile.y, tile.x] for tile in view.occupancy.tiles(zmax))
    (faults / "slow").unlink()
    _, outcome = run_all(workspace, catalogue, scene)
    assert outcome.complete
    assert manifest(workspace).complete
    assert manifest(workspace).content_version == 2, "clients may have seen the first version without these tiles"


def test_a_quarantined_block_leaves_the_rendering_incomplete(workspace: Workspace, catalogue: Catalogue, faults: Path) -> None:
    block = next(job.block for job in _planned(workspace, catalogue))
    (faults / f"{block.z}-{block.x}-{block.y}").write_text("exception")
    _, outcome = run_all(workspace, catalogue, SquareScene(CONTENT))
    assert not outcome.complete
    assert outcome.quarantined_jobs == len(record(catalogue).frames)
    assert not manifest(workspace).complete
    (faults / f"{block.z}-{block.x}-{block.y}").unlink()
    catalogue.retry("r")
    assert run_all(workspace, catalogue, SquareScene(CONTENT))[1].complete


def _planned(workspace: Workspace, catalogue: Catalogue) -> list[object]:
    Run(workspace, catalogue, "r", SETTINGS).plan(scene=SquareScene(CONTENT))
    return [job for job in catalogue.jobs("r") if job.kind == "base"]


def test_blocks_that_nobody_stands_for_are_removed(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    view = record(catalogue).frames[0].id
    root = next(job.block.z for job in catalogue.jobs("r") if job.kind == "base")
    with SqliteTileStore(workspace.store_path("r", view)) as store:
        stray = BlockId(root, 0, 2**root - 1)
        store.put_block(stray, "old", 1, [], None)
        run_all(workspace, catalogue, SquareScene(CONTENT))
        assert store.get_block(stray) is None
        assert len(store.list_blocks()) == len(list(catalogue.jobs("r", view)))


def test_content_that_left_the_frame_stops_before_any_change(workspace: Workspace, catalogue: Catalogue) -> None:
    run_all(workspace, catalogue, SquareScene(CONTENT))
    far = SquareScene(CONTENT, box=((0.0, 0.0, 0.0), (900.0, 100.0, 10.0)))
    with pytest.raises(OutsideFrame, match="--regrid"):
        Run(workspace, catalogue, "r", SETTINGS).plan(scene=far)
    assert catalogue.count_jobs("r")[State.DONE] == len(list(catalogue.jobs("r")))


def test_memory_is_shared_among_workers_and_too_little_is_refused() -> None:
    assert Settings(2).cache_bytes == 512 << 20
    assert Settings(2, 2 << 30).cache_bytes == (1 << 30) - (256 << 20)
    with pytest.raises(BadRequest, match="640 MiB"):
        _ = dataclasses.replace(Settings(2), max_memory_bytes=500 << 20).cache_bytes
