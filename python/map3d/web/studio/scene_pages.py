"""Pages of scenes: list, create, upload, import report, remove."""

import re
from collections.abc import Mapping
from typing import Any, Final

from starlette.datastructures import ImmutableMultiDict
from starlette.responses import Response

from map3d.catalogue import AssetRecord, RenderingRecord, SceneRecord
from map3d.errors import BadRequest, CrsError, Map3dError, NotFound
from map3d.formats import FORMATS
from map3d.ingest.findings import findings
from map3d.lifecycle.create_scene import create_scene
from map3d.publish.published_folders import folders_of
from map3d.requests import AddFiles, CreateScene
from map3d.requests.json_values import from_json
from map3d.scenes.build import is_stale
from map3d.scenes.outliers import read_outliers
from map3d.types import check_name
from map3d.web.http.current import Fields, catalogue, request, workspace
from map3d.web.http.guards import requires
from map3d.web.http.routes import Routes
from map3d.web.pages.tools import translate
from map3d.web.studio.forms import form_values, more_controls
from map3d.web.studio.operation_words import show_all
from map3d.web.studio.outlier_words import outlier_words
from map3d.web.studio.report_words import missing_files, placing_words, summary_of
from map3d.web.studio.shared import ask, check_typed_name, folder_choice, go_to, page

scene_pages = Routes("scene_pages", "/studio")

OPERATIONS: Final = 8
MAX_IMPORT_BYTES: Final = 2 << 20
"""Limit for the form that lists the uploads of an import: 50,000 files."""


@scene_pages.get("/")
@requires("viewer")
def home() -> Response:
    operations = show_all(catalogue().operations(limit=OPERATIONS))
    scenes = [_listed(scene) for scene in catalogue().scenes()]
    return page("home.html", formats=_formats(), scenes=scenes, operations=operations, running=any(one.is_open for one in operations))


@scene_pages.get("/scenes/new")
@requires("editor")
def new_scene() -> Response:
    return _new_scene_page(ImmutableMultiDict(), "")


@scene_pages.post("/scenes/new")
@requires("editor")
def send_new_scene() -> Response:
    try:
        values = form_values(CreateScene, request().form)
        name = values.setdefault("name", name_from(values.get("title", "")))
        create_scene(workspace(), catalogue(), from_json(CreateScene, values))
    except (BadRequest, CrsError) as error:
        return _new_scene_page(request().form, str(error), 400)
    return go_to(f"studio/scenes/{name}")


def _new_scene_page(form: Fields, problem: str, status: int = 200) -> Response:
    return page("new_scene.html", status, form=form, problem=problem, more=more_controls(CreateScene, form))


@scene_pages.get("/scenes/{scene}")
@requires("viewer")
def scene_page(scene: str) -> Response:
    record = catalogue().scene(check_name(scene, "scene"))
    operations = show_all(catalogue().operations(scene=scene, limit=OPERATIONS))
    assets = [summary_of(asset) for asset in catalogue().assets(scene)]
    values: dict[str, Any] = {"scene": record, "assets": assets, "operations": operations, "running": any(one.is_open for one in operations)}
    far = outlier_words(read_outliers(workspace(), scene), record) if assets else None
    stale = bool(assets) and is_stale(workspace(), catalogue(), scene)
    more = more_controls(AddFiles, ImmutableMultiDict())
    return page("scene.html", **values, formats=_formats(), renderings=_listed_renderings(scene), stale=stale, far=far, more=more)


@scene_pages.post("/scenes/{scene}/import", most_bytes=MAX_IMPORT_BYTES)
@requires("editor")
def import_uploads(scene: str) -> Response:
    """Asks for the import of uploads, and for a build after it."""
    catalogue().scene(check_name(scene, "scene"))
    options = form_values(AddFiles, request().form)
    ask("import", scene, files=request().form.getlist("file"), options=options)
    ask("build", scene)
    return go_to(f"studio/scenes/{scene}")


@scene_pages.get("/scenes/{scene}/files/{asset}")
@requires("viewer")
def report(scene: str, asset: str) -> Response:
    record = _asset(scene, asset)
    lines, missing = findings(record.report), missing_files(record)
    return page("report.html", scene=catalogue().scene(scene), asset=summary_of(record), lines=lines, missing=missing, placing=placing_words(record))


@scene_pages.get("/scenes/{scene}/files/{asset}/remove")
@requires("editor")
def remove_file(scene: str, asset: str) -> Response:
    record = _asset(scene, asset)
    return page("remove_file.html", scene=catalogue().scene(scene), asset=record, file=record.source.rsplit("/", 1)[-1])


@scene_pages.post("/scenes/{scene}/files/{asset}/remove")
@requires("editor")
def send_remove_file(scene: str, asset: str) -> Response:
    ask("remove", scene, what="files", names=[_asset(scene, asset).name])
    return go_to(f"studio/scenes/{scene}")


@scene_pages.post("/scenes/{scene}/build")
@requires("editor")
def build(scene: str) -> Response:
    """Asks for a build; with `keep_outliers` or `cluster` (0: the largest) in the form, of what they choose."""
    catalogue().scene(check_name(scene, "scene"))
    ask("build", scene, **_choice(request().form))
    return go_to(f"studio/scenes/{scene}")


@scene_pages.get("/scenes/{scene}/remove")
@requires("editor")
def remove(scene: str) -> Response:
    return _removal_page(scene)


@scene_pages.post("/scenes/{scene}/remove")
@requires("editor")
def send_remove(scene: str) -> Response:
    catalogue().scene(check_name(scene, "scene"))
    try:
        check_typed_name(scene)
    except BadRequest as error:
        return _removal_page(scene, str(error), 400)
    ask("remove", scene, what="scene", with_renderings=True, folders=request().form.getlist("published"))
    return go_to("studio/")


def _formats() -> str:
    return ", ".join(translate(format.uploads) for format in FORMATS)


def _choice(form: Mapping[str, str]) -> dict[str, Any]:
    if form.get("keep_outliers"):
        return {"keep_outliers": True, "cluster": 0}
    cluster = form.get("cluster", "")
    if not cluster:
        return {}
    if not re.fullmatch(r"[0-9]{1,6}", cluster, re.ASCII):
        raise BadRequest(f"cluster {cluster[:64]!r} is not a number")
    return {"keep_outliers": False, "cluster": int(cluster)}


def name_from(title: str) -> str:
    """Returns a valid name for a title: lower case, with dashes."""
    plain = title.lower()
    for letter, letters in (("ä", "ae"), ("ö", "oe"), ("ü", "ue"), ("ß", "ss")):
        plain = plain.replace(letter, letters)
    return re.sub(r"[^a-z0-9]+", "-", plain).strip("-")[:64]


def _removal_page(scene: str, problem: str = "", status: int = 200) -> Response:
    record = catalogue().scene(check_name(scene, "scene"))
    names = [rendering.name for rendering in catalogue().renderings(scene)]
    values = {"name": scene, "title": record.title or scene, "renderings": names, "what": "scene", "problem": problem}
    return page("remove.html", status, **values, **folder_choice(folders_of(workspace(), names)))


def _asset(scene: str, name: str) -> AssetRecord:
    found = [asset for asset in catalogue().assets(check_name(scene, "scene")) if asset.name == name]
    if not found:
        raise NotFound(f"scene {scene}: no file {name[:64]!r}")
    return found[0]


def _listed(scene: SceneRecord) -> dict[str, Any]:
    files = len(catalogue().assets(scene.name))
    return {"record": scene, "files": files, "renderings": _listed_renderings(scene.name)}


def _listed_renderings(scene: str) -> list[dict[str, Any]]:
    return [_listed_rendering(record) for record in catalogue().renderings(scene)]


def _listed_rendering(record: RenderingRecord) -> dict[str, Any]:
    try:
        counts = {str(state): count for state, count in catalogue().count_jobs(record.name).items()}
    except Map3dError:
        counts = {}
    return {"record": record, "jobs": sum(counts.values()), "done": counts.get("done", 0), "quarantined": counts.get("quarantined", 0)}
