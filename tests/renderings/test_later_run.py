"""Options of a later run of `map3d site` change the rendering that exists; what is not given stays."""

import json
import shutil
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from map3d.catalogue import Workspace
from map3d.coherence.import_files import ImportOptions
from map3d.errors import BadRequest
from map3d.lifecycle.change_rendering import change_rendering
from map3d.requests import ChangeRendering, Site
from map3d.requests.heights import HeightChoice
from map3d.requests.param import fields_of
from map3d.requests.scenes import ContentChoice, WorkLimits
from map3d.site.later_run import LaterRun, apply_options
from map3d.types import ViewAngles
from tests.web.workspaces import make_workspace

EVERY_RUN = {"folder", "out", "replace", "name", "strict", "allow_empty"}
"""Fields that each run follows again, besides those of imports, of what the build keeps, and of the limits of the work."""
VIEWS = (ViewAngles(0, 45), ViewAngles(45, 22.5))


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(make_workspace(tmp_path_factory.mktemp("original") / "ws").root)


@pytest.fixture
def workspace(original: Path, tmp_path: Path) -> Workspace:
    return Workspace(Path(shutil.copytree(original, tmp_path / "ws")))


def run(workspace: Workspace, **options: Any) -> LaterRun:
    request = Site(folder=Path("city"), out=Path("out"), name="tea", **options)
    with workspace.open_catalogue() as catalogue:
        record = catalogue.rendering("tea")
        return apply_options(workspace, catalogue, request, record, record.box, 5.0)


def manifest(workspace: Workspace) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(workspace.manifest_path("tea").read_text())
    return found


CHANGES: dict[str, tuple[dict[str, Any], str]] = {
    "res_m": ({"res_m": 0.5}, "--res"),
    "views": ({"views": VIEWS[:1]}, "--view"),
    "color": ({"color": "png"}, "--color"),
    "data": ({"data": "tile"}, "--data"),
    "small": ({"small": True}, "--small"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_what_is_rendered_otherwise_is_rendered_again(workspace: Workspace, name: str) -> None:
    options, says = CHANGES[name]
    with workspace.open_catalogue() as catalogue:
        before = catalogue.rendering("tea")
    done = run(workspace, **options)
    assert (done.again, done.outgrown) == ((says,), False)
    assert done.record.content_version == before.content_version + 1
    assert done.record.res_m == (0.5 if name == "res_m" else before.res_m)
    assert [frame.angles for frame in done.record.frames] == list(options.get("views", VIEWS))
    kinds = {layer.kind for layer in done.record.layers}
    assert kinds == ({"color", "data"} if name == "data" else {layer.kind for layer in before.layers})
    assert {layer.format for layer in done.record.layers if layer.kind == "color"} == {"png" if name == "color" else "webp"}
    assert {layer.small for layer in done.record.layers} == {name == "small"}
    assert run(workspace, **options).again == (), "the same command changes nothing more"
    assert run(workspace).record == done.record, "without the option, what it chose stays"


def test_ambient_occlusion_and_views_are_added_and_left_out(workspace: Workspace) -> None:
    done = run(workspace, ao=True, views=(*VIEWS, ViewAngles(90, 45)))
    assert (done.again, done.added) == ((), ("view 90-45", "ambient occlusion"))
    assert [layer.kind for layer in done.record.passes[-1]] == ["ao"]
    assert len(done.record.passes) == 2
    assert run(workspace, ao=True).added == ()
    done = run(workspace, ao=False)
    assert (done.again, len(done.record.passes), len(done.record.frames)) == (("--no-ao",), 1, 3)


def test_texts_and_start_view_change_without_rendering(workspace: Workspace) -> None:
    before = manifest(workspace)
    done = run(workspace, title="Harbour", attribution="Port", description="The old harbour", start_view=VIEWS[1])
    assert (done.again, done.added) == ((), ())
    texts = {"title": "Harbour", "attribution": "Port", "description": "The old harbour"}
    assert manifest(workspace) == before | texts | {"start": before["start"] | {"view": "45-22.5"}}
    assert run(workspace).record == done.record
    with workspace.open_catalogue() as catalogue:
        change_rendering(workspace, catalogue, "tea", ChangeRendering(description="", title=""))
    assert (manifest(workspace)["title"], "description" in manifest(workspace)) == ("", False)


def test_a_start_view_that_is_not_there_changes_nothing(workspace: Workspace) -> None:
    with workspace.open_catalogue() as catalogue:
        before = catalogue.rendering("tea")
        with pytest.raises(BadRequest, match=r"no view 90-45; it has 0-45, 45-22\.5"):
            change_rendering(workspace, catalogue, "tea", ChangeRendering(title="x", start_view=ViewAngles(90, 45)))
    with pytest.raises(BadRequest, match="--view adds views"):
        run(workspace, res_m=0.5, start_view=ViewAngles(90, 45))
    with workspace.open_catalogue() as catalogue:
        assert catalogue.rendering("tea") == before


def test_a_start_view_that_leaves_gives_way_to_the_first(workspace: Workspace) -> None:
    run(workspace, start_view=VIEWS[1])
    assert run(workspace, views=VIEWS[:1]).record.start_view is None


def test_every_option_of_site_counts_on_a_later_run() -> None:
    imports = {name for name in fields_of(Site) if name in {one.name for one in fields(ImportOptions)}}
    others = {name for request in (HeightChoice, ContentChoice, WorkLimits) for name in fields_of(request)}
    changed = {*CHANGES, "ao", "title", "attribution", "description", "start_view"}
    assert set(fields_of(Site)) - imports - others - EVERY_RUN == changed
