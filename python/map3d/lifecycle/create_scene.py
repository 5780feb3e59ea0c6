"""Creates scenes."""

from dataclasses import fields
from typing import Any

from map3d.catalogue import Catalogue, SceneCrs, SceneRecord, Workspace
from map3d.errors import BadRequest
from map3d.ingest.content import CLUSTER, KEEP_OUTLIERS
from map3d.ingest.scene_crs import parse_scene_crs
from map3d.lifecycle.remove_scene import finish_scene_removal
from map3d.requests import CreateScene
from map3d.requests.scenes import GROUND_PLANES, BuildSteps
from map3d.scenes.shared_scene import FILES, check_files_url
from map3d.scenes.style import STYLE, check_style
from map3d.types import check_name


def check_scene(request: CreateScene) -> None:
    """Raises BadName, CrsError, BadRequest."""
    check_name(request.name, "scene")
    _build_options(request)
    _pinned_crs(request)


def create_scene(workspace: Workspace, catalogue: Catalogue, request: CreateScene) -> SceneRecord:
    """Creates an empty scene. Raises AlreadyExists, BadName, CrsError, BadRequest."""
    check_scene(request)
    finish_scene_removal(workspace, catalogue, request.name)
    options = _build_options(request)
    catalogue.create_scene(SceneRecord(request.name, request.title, request.attribution, crs=_pinned_crs(request), options=options))
    return catalogue.scene(request.name)


def _pinned_crs(request: CreateScene) -> SceneCrs | None:
    return None if request.crs is None else parse_scene_crs(request.crs)


def _build_options(request: CreateScene) -> dict[str, Any]:
    if request.ground_plane not in GROUND_PLANES:
        raise BadRequest(f"scene {request.name}: ground plane is {request.ground_plane!r}, expected {', '.join(GROUND_PLANES)}")
    steps = {step.name: getattr(request, step.name) for step in fields(BuildSteps)}
    shared = {} if request.files is None else {FILES: check_files_url(request.files)}
    rules = [] if request.style is None else check_style(request.style)
    chosen = {name: value for name, value in ((KEEP_OUTLIERS, request.keep_outliers), (CLUSTER, request.cluster), (STYLE, rules)) if value}
    return {**steps, "ground_plane": request.ground_plane, **chosen, **shared}
