"""Scenes, assets and renderings."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest

from map3d.catalogue import AssetRecord, Catalogue, JobResult, PlannedJob, SceneCrs, SceneRecord, State, Workspace
from map3d.catalogue.sqlite import SqliteCatalogue
from map3d.errors import AlreadyExists, BadName, BadRequest, NotFound, StaleFence, StoreError
from map3d.types import BlockId, Layer, Sun, ViewAngles
from tests.catalogue.implementations import rendering

UTM = SceneCrs(25832, "PROJCRS[…]", "ETRS89 / UTM zone 32N", "DHHN2016 height")


def test_records_round_trip(catalogue: Catalogue, open_at: Callable[..., Catalogue]) -> None:
    scene = SceneRecord("b", "Title", "© someone", UTM, (691000.0, 5336000.125, 0.0), {"merge_faces": False}, "abc")
    asset = AssetRecord("b", "x", "/data/x.gml", "citygml", "d", "s", {"triangles": 5})
    catalogue.create_scene(scene)
    catalogue.put_asset(asset)
    again = open_at()
    assert again.scene("b") == scene
    assert again.assets("b") == [asset]
    assert again.rendering("town-a") == rendering()
    assert [kept.name for kept in again.scenes()] == ["b", "town"]
    assert [kept.name for kept in again.renderings("b")] == []


def test_names_are_unique(catalogue: Catalogue) -> None:
    with pytest.raises(AlreadyExists, match="town"):
        catalogue.create_scene(SceneRecord("town"))
    with pytest.raises(AlreadyExists, match="--regrid"):
        catalogue.create_rendering(rendering())


def test_unknown_name_lists_the_existing_ones(catalogue: Catalogue) -> None:
    with pytest.raises(NotFound, match="'twon'; existing scenes: town"):
        catalogue.scene("twon")
    with pytest.raises(NotFound, match="'x'; existing renderings: town-a"):
        catalogue.rendering("x")
    with pytest.raises(NotFound):
        catalogue.create_rendering(dataclasses.replace(rendering("other"), scene="nowhere"))
    with pytest.raises(NotFound):
        catalogue.put_asset(AssetRecord("nowhere", "x", "", "obj", "", ""))
    with pytest.raises(NotFound):
        catalogue.count_jobs("nowhere")


@pytest.mark.parametrize("name", ["", "-a", "A", "a/b", "..", "a" * 65, "ä", "a\n"])
def test_names_that_could_leave_the_workspace_are_refused(catalogue: Catalogue, name: str, tmp_path: Path) -> None:
    with pytest.raises(BadName):
        catalogue.create_scene(SceneRecord(name))
    with pytest.raises(BadName):
        Workspace(tmp_path).scene_folder(name)


def test_first_caller_pins_the_scene(catalogue: Catalogue) -> None:
    assert catalogue.pin_scene("town", crs=UTM).crs == UTM
    assert catalogue.pin_scene("town", origin=(1.0, 2.0, 3.0)).origin == (1.0, 2.0, 3.0)
    other = catalogue.pin_scene("town", crs=SceneCrs(None, None, "local metres"), origin=(0.0, 0.0, 0.0))
    assert (other.crs, other.origin) == (UTM, (1.0, 2.0, 3.0))


def test_options_of_a_scene_are_replaced_as_a_whole(catalogue: Catalogue, open_at: Callable[..., Catalogue]) -> None:
    catalogue.set_scene_options("town", {"keep_outliers": True, "cluster": 2})
    catalogue.set_scene_options("town", {"cluster": 3})
    assert open_at().scene("town").options == {"cluster": 3}
    with pytest.raises(NotFound):
        catalogue.set_scene_options("twon", {})


def test_asset_with_the_same_name_is_replaced(catalogue: Catalogue) -> None:
    for digest in ("old", "new"):
        catalogue.put_asset(AssetRecord("town", "x", "", "obj", digest, ""))
    assert [asset.digest for asset in catalogue.assets("town")] == ["new"]


def test_regrid_removes_jobs_and_increments_the_version(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [PlannedJob("0-45", BlockId(0, 0, 0), "base", 0, "k", None)])
    stale = catalogue.lease("town-a", "w")
    assert stale is not None
    after = catalogue.regrid(dataclasses.replace(rendering(), res_m=0.02))
    assert (after.content_version, after.res_m) == (2, 0.02)
    assert catalogue.rendering("town-a") == after
    assert sum(catalogue.count_jobs("town-a").values()) == 0
    catalogue.plan("town-a", [PlannedJob("0-45", BlockId(0, 0, 0), "base", 0, "k", None)])
    fresh = catalogue.lease("town-a", "w")
    assert fresh is not None
    assert fresh.fence > stale.fence
    assert catalogue.count_jobs("town-a")[State.LEASED] == 1


def test_added_view_keeps_jobs_and_other_views(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [PlannedJob("0-45", BlockId(0, 0, 0), "base", 0, "k", None)])
    before = catalogue.rendering("town-a")
    added = dataclasses.replace(before.frames[0], angles=ViewAngles(90, 45))
    after = catalogue.add_frames("town-a", [added])
    assert after == catalogue.rendering("town-a") == dataclasses.replace(before, frames=(*before.frames, added))
    assert sum(catalogue.count_jobs("town-a").values()) == 1
    with pytest.raises(AlreadyExists, match="90-45"):
        catalogue.add_frames("town-a", [added])
    with pytest.raises(NotFound):
        catalogue.add_frames("other", [added])


def test_added_layers_are_a_new_pass_and_keep_jobs(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [PlannedJob("0-45", BlockId(0, 0, 0), "base", 0, "k", None)])
    before = catalogue.rendering("town-a")
    sun = Sun("2026-06-21T13:00:00Z", 196.2, 64.1, (-0.1, -0.4, 0.9))
    added = (Layer("normal", "normal", "png"), Layer("coarse", "color", "jpeg", 40), Layer("noon", "picture", "webp", 80, (sun,), 20.0))
    after = catalogue.add_pass("town-a", added)
    assert after == catalogue.rendering("town-a") == dataclasses.replace(before, passes=(*before.passes, added))
    assert [layer.name for layer in after.layers] == ["color", "id", "normal", "coarse", "noon"]
    assert [(track.id, track.layers) for track in after.tracks] == [("0-45", before.passes[0]), ("0-45+1", added)]
    assert sum(catalogue.count_jobs("town-a").values()) == 1
    with pytest.raises(AlreadyExists, match="coarse"):
        catalogue.add_pass("town-a", added[1:2])
    with pytest.raises(NotFound):
        catalogue.add_pass("other", added)


def test_described_rendering_keeps_all_else(catalogue: Catalogue) -> None:
    before = catalogue.rendering("town-a")
    after = catalogue.describe_rendering("town-a", "Harbour", "Port", {"description": "old"})
    assert after == catalogue.rendering("town-a")
    assert after == dataclasses.replace(before, title="Harbour", attribution="Port", options={"description": "old"})
    with pytest.raises(NotFound):
        catalogue.describe_rendering("other", "", "", {})


def test_removed_asset_is_gone(catalogue: Catalogue) -> None:
    for name in ("x", "y"):
        catalogue.put_asset(AssetRecord("town", name, "", "obj", "", ""))
    catalogue.remove_asset("town", "x")
    assert [asset.name for asset in catalogue.assets("town")] == ["y"]
    with pytest.raises(NotFound, match="no asset 'x'; existing assets: y"):
        catalogue.remove_asset("town", "x")
    with pytest.raises(NotFound, match="no scene 'nowhere'"):
        catalogue.remove_asset("nowhere", "x")


def test_scene_with_renderings_is_not_removed(catalogue: Catalogue) -> None:
    catalogue.put_asset(AssetRecord("town", "x", "", "obj", "", ""))
    with pytest.raises(BadRequest, match=r"scene town: has renderings \(town-a\)"):
        catalogue.remove_scene("town")
    assert len(catalogue.assets("town")) == 1
    catalogue.remove_rendering("town-a")
    catalogue.remove_scene("town")
    assert catalogue.scenes() == []
    with pytest.raises(NotFound):
        catalogue.remove_scene("town")
    catalogue.create_scene(SceneRecord("town"))
    assert catalogue.assets("town") == []


def test_removed_rendering_is_gone_with_its_jobs(catalogue: Catalogue) -> None:
    jobs = [PlannedJob("0-45", BlockId(4, x, 0), "base", x, "k", None) for x in range(10)]
    catalogue.create_rendering(rendering("other"))
    for name in ("town-a", "other"):
        catalogue.plan(name, jobs)
    catalogue.remove_rendering("town-a")
    assert [kept.name for kept in catalogue.renderings()] == ["other"]
    assert list(catalogue.jobs("town-a")) == []
    assert len(list(catalogue.jobs("other"))) == catalogue.count_jobs("other")[State.TODO] == 10
    for call in (catalogue.remove_rendering, catalogue.count_jobs):
        with pytest.raises(NotFound):
            call("town-a")


def test_rendering_created_again_continues_versions_and_fences(catalogue: Catalogue) -> None:
    """Otherwise caches would take its tiles for the removed ones, and a worker could commit a block of the removed rendering."""
    job = PlannedJob("0-45", BlockId(0, 0, 0), "base", 0, "k", None)
    catalogue.plan("town-a", [job])
    stale = catalogue.lease("town-a", "w")
    assert stale is not None
    catalogue.remove_rendering("town-a")
    catalogue.create_rendering(rendering())
    assert catalogue.rendering("town-a").content_version == 2
    assert sum(catalogue.count_jobs("town-a").values()) == 0
    catalogue.plan("town-a", [job])
    fresh = catalogue.lease("town-a", "w")
    assert fresh is not None
    assert fresh.fence > stale.fence
    with pytest.raises(StaleFence):
        catalogue.done(stale, JobResult(1, False))


def test_file_that_is_not_a_catalogue_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "catalogue.sqlite"
    path.write_bytes(b"not a database at all" * 100)
    with pytest.raises(StoreError, match=r"catalogue\.sqlite"):
        SqliteCatalogue(path)


def test_missing_workspace_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="create-scene"):
        Workspace(tmp_path / "nowhere").open_catalogue()
