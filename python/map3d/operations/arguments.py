"""The arguments of operations, as JSON schemas. The REST API publishes the same schemas."""

from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from map3d.errors import BadRequest
from map3d.requests import AddFiles, Build, Publish, RemoveScene, Render
from map3d.requests.json_values import schemas_of
from map3d.requests.publications import FOLDER_NAME

_WITH_RENDERINGS: Final = schemas_of(RemoveScene)["with_renderings"]
_NAMES: Final = {"type": "array", "items": {"type": "string"}, "minItems": 1}

ARGUMENTS: Final[Mapping[str, Mapping[str, Any]]] = {
    "import": {
        "type": "object",
        "additionalProperties": False,
        "minProperties": 1,
        "description": "Imports uploaded files, and files of the server's host in the folders that its administrator allows.",
        "properties": {
            "files": {**_NAMES, "description": "Ids of complete uploads; ZIP archives are unpacked."},
            "paths": {**_NAMES, "description": "Files and folders of the server's host."},
            "options": {"type": "object", "additionalProperties": False, "properties": schemas_of(AddFiles)},
        },
    },
    "build": {
        "type": "object",
        "additionalProperties": False,
        "description": "Builds the scene if its files, or what it keeps of them, have changed.",
        "properties": schemas_of(Build),
    },
    "render": {
        "type": "object",
        "additionalProperties": False,
        "description": "Builds the scene if its files have changed, then renders the missing and changed tiles.",
        "properties": schemas_of(Render),
    },
    "publish": {
        "type": "object",
        "additionalProperties": False,
        "description": "Writes the rendering as static files, or updates them.",
        "properties": schemas_of(Publish),
    },
    "remove": {
        "type": "object",
        "additionalProperties": False,
        "required": ["what"],
        "description": "Removes a scene, some of its files, a rendering, or a published folder of it. The target is the scene or the rendering.",
        "properties": {
            "what": {"type": "string", "enum": ["scene", "files", "rendering", "published"]},
            "names": {**_NAMES, "description": "files: names of assets."},
            "folder": {
                "type": "string",
                "pattern": FOLDER_NAME,
                "description": "published: name of the folder in the workspace's folder published/.",
            },
            "with_renderings": {**_WITH_RENDERINGS, "description": f"scene: {_WITH_RENDERINGS['description']}"},
            "folders": {
                "type": "array",
                "items": {"type": "string", "pattern": FOLDER_NAME},
                "description": "rendering, scene: names of the published folders to remove too; the others stay. "
                "Needed if the renderings are published, even if the list is empty.",
            },
        },
    },
}
"""Operation kind → JSON schema of its arguments, in the subset that OpenAPI 3.0 shares."""


def check_arguments(kind: str, target: str, arguments: Mapping[str, Any]) -> None:
    """Raises BadRequest for arguments that the kind of operation does not have, or for an unknown kind."""
    if kind not in ARGUMENTS:
        raise BadRequest(f"operation {kind!r}: unknown kind; use {', '.join(ARGUMENTS)}")
    error = next(_validator(kind).iter_errors(dict(arguments)), None)
    if error is not None:
        raise BadRequest(f"operation {kind} {target}: arguments{place_of(error)}: {error.message[:300]}")
    if kind == "remove" and (arguments["what"] == "files") != ("names" in arguments):
        raise BadRequest(f"operation remove {target}: give names to remove files, and only then")
    if kind == "remove" and (arguments["what"] == "published") != ("folder" in arguments):
        raise BadRequest(f"operation remove {target}: give folder to remove a published folder, and only then")
    if kind == "remove" and "folders" in arguments and arguments["what"] not in ("rendering", "scene"):
        raise BadRequest(f"operation remove {target}: give folders only to remove a rendering or a scene")
    if kind == "import" and not {"files", "paths"} & set(arguments):
        raise BadRequest(f"operation import {target}: give files (ids of uploads) or paths")


def place_of(error: Any) -> str:
    """Returns the place of a validation error in its document, as in `.files[3]`."""
    return "".join(f".{part}" if isinstance(part, str) else f"[{part}]" for part in error.absolute_path)


@cache
def _validator(kind: str) -> Any:
    from jsonschema import Draft202012Validator

    return Draft202012Validator(ARGUMENTS[kind])
