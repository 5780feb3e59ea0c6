"""The arguments of operations, as JSON schemas. The REST API publishes the same schemas."""

from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from map3d.errors import BadRequest
from map3d.requests import AddFiles, Build, Publish, Render
from map3d.requests.json_values import schemas_of
from map3d.requests.param import fields_of
from map3d.requests.removals import REMOVALS

_NAMES: Final = {"type": "array", "items": {"type": "string"}, "minItems": 1}
_REMOVAL_FIELDS: Final = {
    name: [what for what, request in REMOVALS.items() if name in schemas_of(request)] for one in REMOVALS.values() for name in schemas_of(one)
}
"""Field of a removal → what has it."""


def _removal_schema(name: str, whats: list[str]) -> dict[str, Any]:
    schema = schemas_of(REMOVALS[whats[0]])[name]
    return {**schema, "description": f"{', '.join(whats)}: {schema['description']}"}


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
            "what": {"type": "string", "enum": list(REMOVALS)},
            **{name: _removal_schema(name, whats) for name, whats in _REMOVAL_FIELDS.items()},
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
    if kind == "remove":
        _check_removal(target, arguments)
    if kind == "import" and not {"files", "paths"} & set(arguments):
        raise BadRequest(f"operation import {target}: give files (ids of uploads) or paths")


def _check_removal(target: str, arguments: Mapping[str, Any]) -> None:
    for name, whats in _REMOVAL_FIELDS.items():
        required = fields_of(REMOVALS[whats[0]])[name].required
        if (name in arguments and arguments["what"] not in whats) or (required and name not in arguments and arguments["what"] in whats):
            raise BadRequest(f"operation remove {target}: give {name} to remove {' or '.join(whats)}, and only then")


def place_of(error: Any) -> str:
    """Returns the place of a validation error in its document, as in `.files[3]`."""
    return "".join(f".{part}" if isinstance(part, str) else f"[{part}]" for part in error.absolute_path)


@cache
def _validator(kind: str) -> Any:
    from jsonschema import Draft202012Validator

    return Draft202012Validator(ARGUMENTS[kind])
