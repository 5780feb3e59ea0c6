"""Pages of renderings: create with a live preview and an estimate, progress, quarantine, publish, remove."""

from datetime import datetime
from itertools import islice
from typing import Any, Final

from starlette.datastructures import ImmutableMultiDict
from starlette.responses import Response

from map3d.catalogue import OperationRecord, RenderingRecord, State
from map3d.catalogue.operation_records import OperationState
from map3d.cores import usable_cores
from map3d.errors import BadRequest, Map3dError
from map3d.lifecycle.change_rendering import change_rendering
from map3d.lifecycle.create_rendering import create_rendering
from map3d.publish.published_folders import find_published, folders_of, published_folders
from map3d.requests import ChangeRendering, CreateRendering, Publish
from map3d.requests.json_values import from_json
from map3d.scenes.build import is_stale
from map3d.tiles.track_stores import read_manifest
from map3d.types import check_name
from map3d.web.http.current import Fields, catalogue, request, site, workspace
from map3d.web.http.guards import requires
from map3d.web.http.responses import json_value
from map3d.web.http.routes import Routes
from map3d.web.pages.formats import duration, size
from map3d.web.pages.tools import translate
from map3d.web.studio.forms import form_values, more_controls
from map3d.web.studio.operation_words import show_all
from map3d.web.studio.rendering_form import RenderingForm, read_form, read_preview
from map3d.web.studio.scene_pages import name_from
from map3d.web.studio.shared import ask, check_typed_name, folder_choice, go_to, page

rendering_pages = Routes("rendering_pages", "/studio")

OPERATIONS: Final = 6
QUARANTINED: Final = 50
PREVIEW_AGE_S: Final = 300


@rendering_pages.get("/scenes/{scene}/renderings/new")
@requires("editor")
def new_rendering(scene: str) -> Response:
    """Shows the form; without JavaScript, its button "Update preview" shows it again with other pictures."""
    form = read_form(request().query_params)
    return _form_page(scene, form, form.problem)


@rendering_pages.post("/scenes/{scene}/renderings/new")
@requires("editor")
def send_new_rendering(scene: str) -> Response:
    form = read_form(request().form)
    name = form.name or name_from(form.title) or scene
    try:
        create_rendering(workspace(), catalogue(), form.request(scene, name))
    except BadRequest as error:
        return _form_page(scene, form, str(error), 400)
    ask("render", name)
    return go_to(f"studio/renderings/{name}")


@rendering_pages.get("/scenes/{scene}/preview.jpg")
@requires("editor")
def preview(scene: str) -> Response:
    wanted = read_preview(request().query_params)
    record = catalogue().scene(check_name(scene, "scene"))
    layer = wanted.layer(record, site().previews.box(catalogue(), scene))
    drawn = site().previews.picture(catalogue(), scene, wanted.view, layer, wanted.res_m, wanted.at)
    return Response(drawn, 200, {"Cache-Control": f"private, max-age={PREVIEW_AGE_S}"}, "image/jpeg")


@rendering_pages.get("/scenes/{scene}/estimate.json")
@requires("editor")
def estimate(scene: str) -> Response:
    """Returns the estimate in words, or a problem in words."""
    try:
        return json_value(_estimate_words(scene, read_form(request().query_params)))
    except BadRequest as error:
        return json_value({"problem": str(error)}, 400)


@rendering_pages.get("/renderings/{rendering}")
@requires("viewer")
def rendering_page(rendering: str) -> Response:
    return _rendering_page(rendering, ImmutableMultiDict())


@rendering_pages.post("/renderings/{rendering}/render")
@requires("editor")
def render(rendering: str) -> Response:
    catalogue().rendering(check_name(rendering, "rendering"))
    ask("render", rendering, **({"retry_quarantined": True} if request().form.get("retry") else {}))
    return go_to(f"studio/renderings/{rendering}")


@rendering_pages.post("/renderings/{rendering}/change")
@requires("editor")
def change(rendering: str) -> Response:
    catalogue().rendering(check_name(rendering, "rendering"))
    sent = request().form
    texts = {one: sent[one].strip() for one in ("title", "attribution", "description") if one in sent}
    try:
        change_rendering(workspace(), catalogue(), rendering, from_json(ChangeRendering, {**form_values(ChangeRendering, sent), **texts}))
    except BadRequest as error:
        return _rendering_page(rendering, ImmutableMultiDict(), str(error), 400)
    return go_to(f"studio/renderings/{rendering}")


@rendering_pages.post("/renderings/{rendering}/publish")
@requires("editor")
def publish(rendering: str) -> Response:
    catalogue().rendering(check_name(rendering, "rendering"))
    try:
        ask("publish", rendering, **form_values(Publish, request().form))
    except BadRequest as error:
        return _rendering_page(rendering, request().form, str(error), 400)
    return go_to(f"studio/renderings/{rendering}")


@rendering_pages.get("/renderings/{rendering}/published/{folder}/remove")
@requires("editor")
def remove_folder(rendering: str, folder: str) -> Response:
    return _folder_removal_page(rendering, folder)


@rendering_pages.post("/renderings/{rendering}/published/{folder}/remove")
@requires("editor")
def send_remove_folder(rendering: str, folder: str) -> Response:
    find_published(workspace(), catalogue().rendering(check_name(rendering, "rendering")).name, folder)
    try:
        check_typed_name(folder)
    except BadRequest as error:
        return _folder_removal_page(rendering, folder, str(error), 400)
    ask("remove", rendering, what="published", folder=folder)
    return go_to(f"studio/renderings/{rendering}")


@rendering_pages.get("/renderings/{rendering}/remove")
@requires("editor")
def remove(rendering: str) -> Response:
    return _removal_page(rendering)


@rendering_pages.post("/renderings/{rendering}/remove")
@requires("editor")
def send_remove(rendering: str) -> Response:
    record = catalogue().rendering(check_name(rendering, "rendering"))
    try:
        check_typed_name(rendering)
    except BadRequest as error:
        return _removal_page(rendering, str(error), 400)
    ask("remove", rendering, what="rendering", folders=request().form.getlist("published"))
    return go_to(f"studio/scenes/{record.scene}")


def _rendering_page(rendering: str, sent: Fields, problem: str = "", status: int = 200) -> Response:
    """`sent`: the form of a publication with a `problem`."""
    record = catalogue().rendering(check_name(rendering, "rendering"))
    found = catalogue().operations(scene=record.scene, limit=50)
    operations = show_all([one for one in found if _is_about(one, rendering)][:OPERATIONS])
    running = any(one.state in ("waiting", "running") for one in operations)
    counts = {str(state): count for state, count in catalogue().count_jobs(rendering).items()}
    values: dict[str, Any] = {"operations": operations, "running": running, "counts": counts, "jobs": sum(counts.values())}
    quarantine = list(islice(catalogue().jobs(rendering, state=State.QUARANTINED), QUARANTINED))
    has_map = read_manifest(workspace(), record) is not None
    values |= {"rendering": record, "scene": catalogue().scene(record.scene), "folders": published_folders(workspace(), rendering)}
    values |= {"more": more_controls(Publish, sent), "problem": problem}
    return page("rendering.html", status, **values, quarantine=quarantine, has_map=has_map, changed=has_map and _is_changed(record, found))


def _folder_removal_page(rendering: str, folder: str, problem: str = "", status: int = 200) -> Response:
    record = catalogue().rendering(check_name(rendering, "rendering"))
    found = find_published(workspace(), rendering, folder)
    return page("remove_folder.html", status, rendering=record, folder=found, problem=problem)


def _removal_page(rendering: str, problem: str = "", status: int = 200) -> Response:
    record = catalogue().rendering(check_name(rendering, "rendering"))
    values = {"name": rendering, "title": record.title or rendering, "renderings": [], "what": "rendering", "problem": problem}
    return page("remove.html", status, **values, **folder_choice(folders_of(workspace(), [rendering])))


def _form_page(scene: str, form: RenderingForm, problem: str, status: int = 200) -> Response:
    record = catalogue().scene(check_name(scene, "scene"))
    built = bool(catalogue().assets(scene)) and not is_stale(workspace(), catalogue(), scene)
    words: dict[str, Any] = {}
    asked = request()
    sent = asked.form if asked["method"] == "POST" else asked.query_params
    if built and asked.query_params.get("estimate"):
        try:
            words = _estimate_words(scene, form)
        except Map3dError as error:
            words = {"problem": str(error)}
    values = {"scene": record, "form": form, "problem": problem, "built": built, "words": words}
    return page("new_rendering.html", status, **values, more=more_controls(CreateRendering, sent), query=asked.query_params)


def _estimate_words(scene: str, form: RenderingForm) -> dict[str, str]:
    found = site().previews.estimate(catalogue(), form.request(scene, "estimate-of-a-new-rendering"), usable_cores())
    return {
        "tiles": translate("{tiles} tiles in {images} images", tiles=found["tiles"], images=found["images"]),
        "size": size(found["bytes"]),
        "time": translate("about {time} on this server", time=duration(found["seconds"])),
    }


def _is_about(operation: OperationRecord, rendering: str) -> bool:
    """Whether an operation of the rendering's scene is about the rendering: a scene may have the same name."""
    kinds = operation.kind in ("render", "publish") or operation.arguments.get("what") in ("rendering", "published")
    return operation.target == rendering and kinds


def _is_changed(record: RenderingRecord, operations: list[OperationRecord]) -> bool:
    """Whether the files of the scene changed after the last render that the operations know of."""
    if is_stale(workspace(), catalogue(), record.scene):
        return True
    rendered = _last([one for one in operations if one.kind == "render" and one.target == record.name])
    changed = _last([one for one in operations if one.kind == "import" or (one.kind == "remove" and one.arguments.get("what") == "files")])
    return changed is not None and rendered is not None and changed > rendered


def _last(operations: list[OperationRecord]) -> datetime | None:
    return max((one.ended for one in operations if one.ended is not None and one.state is OperationState.DONE), default=None)
