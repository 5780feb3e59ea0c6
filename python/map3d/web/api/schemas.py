"""The JSON schemas of the REST API: what requests contain and what answers contain. In the subset that OpenAPI 3.0 and JSON Schema share."""

from collections.abc import Mapping
from typing import Any, Final

from map3d.catalogue import OperationState, State
from map3d.catalogue.operation_records import OPERATION_KINDS
from map3d.operations.arguments import ARGUMENTS
from map3d.requests import ChangeRendering, CreateRendering, CreateScene
from map3d.requests.json_values import schemas_of
from map3d.requests.scenes import BuildSteps
from map3d.types import LAYER_KINDS

Schema = Mapping[str, Any]

TEXT: Final = {"type": "string"}
COUNT: Final = {"type": "integer", "minimum": 0}
_NUMBER: Final = {"type": "number"}
_FLAG: Final = {"type": "boolean"}
_TIME: Final = {"type": "string", "format": "date-time"}
_NAME: Final = {"type": "string", "pattern": "^[a-z0-9][a-z0-9_-]{0,63}$"}


def ref(name: str) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/{name}"}


def _object(properties: Mapping[str, Any], required: str = "", **more: Any) -> dict[str, Any]:
    """`required`: names separated by spaces; "*" for all."""
    names = list(properties) if required == "*" else required.split()
    return {"type": "object", "additionalProperties": False, "properties": dict(properties), **({"required": names} if names else {}), **more}


def _array(items: Any, length: int | None = None, **more: Any) -> dict[str, Any]:
    return {"type": "array", "items": items, **({} if length is None else {"minItems": length, "maxItems": length}), **more}


def _message(name: str, about: str = "English text.") -> dict[str, Any]:
    """Returns the members of a message: its text, its code and the values that the text names; only the text is always there."""
    return {name: {**TEXT, "description": about}, f"{name}_code": TEXT, f"{name}_values": {"type": "object"}}


def _page(name: str, item: str) -> dict[str, Any]:
    """Returns the schema of a page of a list."""
    rest = {**TEXT, "description": "Pass it as the parameter that begins the next page; absent on the last page."}
    return _object({name: _array(ref(item)), "next": rest}, name)


_STEPS: Final = schemas_of(BuildSteps)
_NEW_SCENE: Final = {name: schema for name, schema in schemas_of(CreateScene).items() if name not in _STEPS}

SCHEMAS: Final[dict[str, Schema]] = {
    "Problem": {
        "type": "object",
        "description": "An error, as in RFC 9457.",
        "properties": {"type": TEXT, "title": TEXT, "status": {"type": "integer"}, "detail": TEXT, "code": TEXT, "values": {"type": "object"}},
        "required": ["type", "title", "status", "detail"],
    },
    "Crs": _object({"name": TEXT, "epsg": {"type": "integer"}, "vertical": TEXT}, "name"),
    "Scene": _object(
        {
            "name": _NAME,
            "title": TEXT,
            "attribution": TEXT,
            "crs": {**ref("Crs")},
            "origin": _array(_NUMBER, 3, description="In the scene's coordinate system, metres; absent before the first file."),
            "built": {**_FLAG, "description": "Whether the scene was built; a render builds it again if its files have changed."},
        },
        "name title attribution built",
    ),
    "NewScene": _object({**_NEW_SCENE, "name": _NAME, "options": _object(_STEPS)}, "name"),
    "Asset": _object({"name": _NAME, "file": TEXT, "format": TEXT, "digest": TEXT, "triangles": COUNT, "skipped": COUNT, "warnings": COUNT}, "*"),
    "AssetReport": _object(
        {
            "name": _NAME,
            "file": TEXT,
            "format": TEXT,
            "digest": TEXT,
            "report": {"type": "object", "description": "Findings (codes with counts, examples and English texts); how coordinates were placed."},
        },
        "*",
    ),
    "Layer": _object({"name": _NAME, "kind": {"type": "string", "enum": list(LAYER_KINDS)}, "format": TEXT}, "*"),
    "Rendering": _object(
        {
            "name": _NAME,
            "scene": _NAME,
            "title": TEXT,
            "attribution": TEXT,
            "description": TEXT,
            "start_view": {**TEXT, "description": "Id of the view in which the map opens."},
            "res_m": {**_NUMBER, "description": "Metres per pixel at the deepest level."},
            "tile_px": COUNT,
            "levels": COUNT,
            "views": _array({**TEXT, "description": "Look-at angle and pitch, as in 45-22.5."}),
            "layers": _array(ref("Layer")),
            "content_version": COUNT,
        },
        "*",
    ),
    "NewRendering": _object({**schemas_of(CreateRendering), "scene": _NAME, "name": _NAME}, "scene name"),
    "RenderingChange": _object(schemas_of(ChangeRendering), minProperties=1),
    "Estimate": _object(
        {
            **dict.fromkeys(("base_tiles", "tiles", "images", "bytes", "open_tiles"), COUNT),
            "seconds": {"type": "number", "minimum": 0, "description": "Time to render the open tiles with this number of workers."},
            "workers": COUNT,
            "how": TEXT,
        },
        "*",
    ),
    "Jobs": _object(
        {"rendering": _NAME, "counts": _object(dict.fromkeys(State, COUNT), "*"), "complete": _FLAG}, "*", description="Blocks by state."
    ),
    "Failure": _object({"track": TEXT, "block": TEXT, "kind": TEXT, "attempts": COUNT, **_message("reason")}, "track block kind attempts reason"),
    "Failures": _object({"failures": _array(ref("Failure")), "total": COUNT}, "*"),
    "Operation": _object(
        {
            "id": TEXT,
            "kind": {"type": "string", "enum": list(OPERATION_KINDS)},
            "target": TEXT,
            "scene": TEXT,
            "arguments": {"type": "object"},
            "state": {"type": "string", "enum": list(OperationState)},
            "cancelling": _FLAG,
            **_message("stage"),
            "done": COUNT,
            "total": {**COUNT, "description": "0 if it is unknown."},
            **_message("message", "How the operation ended."),
            "asked_by": TEXT,
            "created": _TIME,
            "started": _TIME,
            "ended": _TIME,
        },
        "id kind target scene arguments state cancelling stage done total message asked_by created",
    ),
    "NewOperation": _object(
        {
            "kind": {"type": "string", "enum": list(OPERATION_KINDS)},
            "target": {**_NAME, "description": "Name of a scene; of a rendering for render, publish and the removal of a rendering."},
            "arguments": {"type": "object", "description": f"Depends on the kind: {', '.join(f'{kind.title()}Arguments' for kind in ARGUMENTS)}."},
        },
        "kind target",
    ),
    **{f"{kind.title()}Arguments": schema for kind, schema in ARGUMENTS.items()},
    "LogLine": _object({"number": COUNT, "time": _TIME, **_message("text")}, "*"),
    "Log": _object({"lines": _array(ref("LogLine")), "next": {**COUNT, "description": "Pass it as `after` for later lines."}}, "*"),
    "Scenes": _page("scenes", "Scene"),
    "Assets": _page("assets", "Asset"),
    "Renderings": _page("renderings", "Rendering"),
    "Operations": _page("operations", "Operation"),
}
