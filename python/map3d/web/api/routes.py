"""The REST API (docs/api.md): scenes, files, renderings, jobs and operations as JSON. Long work is an operation, done by another process."""

from threading import Lock
from typing import Any, Final

from map3d.catalogue import OperationState, State
from map3d.errors import BadRequest, NotFound, Unavailable
from map3d.lifecycle.change_rendering import change_rendering
from map3d.lifecycle.create_rendering import create_rendering
from map3d.lifecycle.create_scene import create_scene
from map3d.operations.estimating import estimate_apart
from map3d.operations.request_operation import request_operation
from map3d.requests import ChangeRendering, CreateRendering, CreateScene
from map3d.requests.json_values import from_json
from map3d.web.api.declare_route import LIMIT, MAX_PAGE, Query, api, route
from map3d.web.api.openapi import openapi_document
from map3d.web.api.values import asset_report_value, asset_value, failure_value, line_value, operation_value, rendering_value, scene_value
from map3d.web.http.current import catalogue, workspace
from map3d.web.http.guards import require

PAGE: Final = 100
ESTIMATE_AGAIN_S: Final = 10
_AFTER: Final = Query("after", "Name after which the page begins.")
_estimating: Final = Lock()
__all__ = ["api"]


@route("GET", "/openapi.json", "This document.", "OpenApi")
def openapi() -> dict[str, Any]:
    return openapi_document()


# -- scenes ------------------------------------------------------------------------------------------------------------------------------


@route("GET", "/scenes", "Lists the scenes, ordered by name.", "Scenes", role="viewer", query=(LIMIT, _AFTER))
def scenes(limit: int | None, after: str | None) -> dict[str, Any]:
    return _page("scenes", [scene_value(record) for record in catalogue().scenes()], limit, after)


@route("POST", "/scenes", "Creates an empty scene.", "Scene", role="editor", status=201, body="NewScene")
def new_scene(body: dict[str, Any]) -> Any:
    values = {**body, **body.get("options", {})}
    values.pop("options", None)
    record = create_scene(workspace(), catalogue(), from_json(CreateScene, values))
    return scene_value(record), {"Location": f"scenes/{record.name}"}


@route("GET", "/scenes/{scene}", "Returns a scene.", "Scene", role="viewer")
def scene(scene: str) -> dict[str, Any]:
    return scene_value(catalogue().scene(scene))


@route("GET", "/scenes/{scene}/assets", "Lists the imported files of a scene.", "Assets", role="viewer", query=(LIMIT, _AFTER))
def assets(scene: str, limit: int | None, after: str | None) -> dict[str, Any]:
    return _page("assets", [asset_value(record) for record in catalogue().assets(scene)], limit, after)


@route("GET", "/scenes/{scene}/assets/{asset}", "Returns the import report of a file.", "AssetReport", role="viewer")
def asset(scene: str, asset: str) -> dict[str, Any]:
    for record in catalogue().assets(scene):
        if record.name == asset:
            return asset_report_value(record)
    raise NotFound(f"scene {scene}: no asset {asset[:64]!r}")


# -- renderings --------------------------------------------------------------------------------------------------------------------------


@route("GET", "/renderings", "Lists the renderings, ordered by name.", "Renderings", query=(Query("scene", "Only those of a scene."), LIMIT, _AFTER))
def renderings(scene: str | None, limit: int | None, after: str | None) -> dict[str, Any]:
    return _page("renderings", [rendering_value(record) for record in catalogue().renderings(scene)], limit, after)


@route("POST", "/renderings", "Creates a rendering of a built scene.", "Rendering", role="editor", status=201, body="NewRendering")
def new_rendering(body: dict[str, Any]) -> Any:
    record = create_rendering(workspace(), catalogue(), from_json(CreateRendering, body))
    return rendering_value(record), {"Location": f"renderings/{record.name}"}


@route("GET", "/renderings/{rendering}", "Returns a rendering.", "Rendering")
def rendering(rendering: str) -> dict[str, Any]:
    return rendering_value(catalogue().rendering(rendering))


@route("PATCH", "/renderings/{rendering}", "Changes texts and start view of a rendering.", "Rendering", role="editor", body="RenderingChange")
def change(rendering: str, body: dict[str, Any]) -> dict[str, Any]:
    return rendering_value(change_rendering(workspace(), catalogue(), rendering, from_json(ChangeRendering, body)))


@route(
    "GET",
    "/renderings/{rendering}/estimate",
    "Estimates tiles, bytes and time before a render. Renders some blocks as a sample, which takes seconds; one estimate at a time.",
    "Estimate",
    role="viewer",
    query=(Query("workers", "Number of parallel processes; one per core of the server by default.", 512, 1),),
)
def estimate(rendering: str, workers: int | None) -> dict[str, Any]:
    catalogue().rendering(rendering)
    if not _estimating.acquire(blocking=False):
        raise Unavailable("another estimate is being computed; try again in some seconds", ESTIMATE_AGAIN_S)
    try:
        return vars(estimate_apart(workspace(), rendering, workers))
    finally:
        _estimating.release()


@route("GET", "/renderings/{rendering}/jobs", "Counts the blocks of a rendering by state.", "Jobs", role="viewer")
def jobs(rendering: str) -> dict[str, Any]:
    counts = catalogue().count_jobs(rendering)
    return {"rendering": rendering, "counts": counts, "complete": counts[State.DONE] == sum(counts.values()) > 0}


@route("GET", "/renderings/{rendering}/failures", "Lists blocks in quarantine with the reasons.", "Failures", role="viewer", query=(LIMIT,))
def failures(rendering: str, limit: int | None) -> dict[str, Any]:
    total = catalogue().count_jobs(rendering)[State.QUARANTINED]
    found = catalogue().jobs(rendering, state=State.QUARANTINED)
    return {"failures": [failure_value(job) for job, _ in zip(found, range(limit or PAGE), strict=False)], "total": total}


# -- operations --------------------------------------------------------------------------------------------------------------------------


@route(
    "GET",
    "/operations",
    "Lists operations, newest first.",
    "Operations",
    role="viewer",
    query=(
        Query("target", "Only those on a scene or rendering of this name."),
        Query("scene", "Only those on a scene and its renderings."),
        Query("state", f"Only those in these states, separated by commas: {', '.join(OperationState)}."),
        LIMIT,
        Query("before", "Id of the operation before which the page begins."),
    ),
)
def operations(target: str | None, scene: str | None, state: str | None, limit: int | None, before: str | None) -> dict[str, Any]:
    length = limit or PAGE
    found = catalogue().operations(target, _states(state), length + 1, scene=scene, before=before)
    return {"operations": [operation_value(record) for record in found[:length]], **({"next": found[length - 1].id} if len(found) > length else {})}


@route("POST", "/operations", "Asks for an operation.", "Operation", role="editor", status=202, body="NewOperation")
def new_operation(body: dict[str, Any]) -> Any:
    asked_by = require("editor").user
    record = request_operation(workspace(), catalogue(), body["kind"], body["target"], body.get("arguments", {}), asked_by)
    return operation_value(record), {"Location": f"operations/{record.id}"}


@route("GET", "/operations/{id}", "Returns an operation with its progress.", "Operation", role="viewer")
def operation(id: str) -> dict[str, Any]:
    return operation_value(catalogue().operation(id))


@route(
    "GET",
    "/operations/{id}/log",
    "Returns lines of an operation's log.",
    "Log",
    role="viewer",
    query=(LIMIT, Query("after", "Number of the line after which to begin.", 10**12)),
)
def operation_log(id: str, limit: int | None, after: int | None) -> dict[str, Any]:
    lines = catalogue().operation_log(id, after or 0, limit or MAX_PAGE)
    return {"lines": [line_value(line) for line in lines], "next": lines[-1].number if lines else after or 0}


@route("POST", "/operations/{id}/cancel", "Cancels an operation; a running one stops within seconds.", "Operation", role="editor", status=202)
def cancel_operation(id: str) -> dict[str, Any]:
    return operation_value(catalogue().cancel_operation(id))


@route("POST", "/operations/{id}/retry", "Does a failed or cancelled operation again.", "Operation", role="editor", status=202)
def retry_operation(id: str) -> dict[str, Any]:
    return operation_value(catalogue().retry_operation(id))


# -- parameters --------------------------------------------------------------------------------------------------------------------------


def _page(name: str, values: list[dict[str, Any]], limit: int | None, after: str | None) -> dict[str, Any]:
    """Returns a page of values that are ordered by name."""
    length = limit or PAGE
    rest = values if after is None else [value for value in values if value["name"] > after]
    return {name: rest[:length], **({"next": rest[length - 1]["name"]} if len(rest) > length else {})}


def _states(text: str | None) -> list[OperationState] | None:
    if text is None:
        return None
    try:
        return [OperationState(part) for part in text.split(",")]
    except ValueError:
        raise BadRequest(f"state={text[:64]!r}: use {', '.join(OperationState)}, separated by commas") from None
