"""The arguments of operations, as JSON schemas. The REST API publishes the same schemas."""

from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from map3d.errors import BadRequest
from map3d.publish.published_folders import FOLDER_NAME

_WORKERS: Final = {"type": "integer", "minimum": 1, "maximum": 512, "description": "Number of parallel processes; one per core by default."}
_MEMORY: Final = {"type": "integer", "minimum": 1, "description": "Memory limit in bytes for all processes together."}
_IMPORT_OPTIONS: Final = {
    "type": "object",
    "additionalProperties": False,
    "properties": {
        "crs": {"type": "string", "description": "Coordinate system of the files, where they do not state it or state it wrongly."},
        "name": {"type": "string", "description": "Name of the asset, for a single file."},
        "up": {"type": "string", "enum": ["y", "z"], "description": "OBJ: the axis that points up."},
        "split": {"type": "string", "enum": ["file", "group"], "description": "OBJ: the part that becomes one object."},
        "theme": {"type": "string", "description": "CityGML: the appearance theme to use."},
        "lod": {"type": "string", "description": "CityGML: the level of detail to use."},
        "interiors": {"type": "boolean", "description": "CityGML: draw rooms and what is in them."},
        "transparency": {
            "type": "string",
            "enum": ["auto", "as-is", "inverted"],
            "description": "How transparency of materials is read; inverted: it is opacity.",
        },
        "max_error_m": {
            "type": "number",
            "minimum": 0,
            "description": "Elevation models: greatest height error of the triangles; 0 keeps every height.",
        },
        "strict": {"type": "boolean", "description": "Stop at the first problem instead of skipping and counting it."},
        "parse_memory_bytes": {"type": "integer", "minimum": 1, "description": "Memory limit for reading a file."},
        "parse_cpu_s": {"type": "integer", "minimum": 1, "description": "Limit in CPU seconds for reading a file."},
    },
}
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
            "options": _IMPORT_OPTIONS,
        },
    },
    "build": {
        "type": "object",
        "additionalProperties": False,
        "description": "Builds the scene if its files, or what it keeps of them, have changed.",
        "properties": {
            "workers": _WORKERS,
            "max_memory_bytes": _MEMORY,
            "keep_outliers": {"type": "boolean", "description": "Keep content however far it is from the rest."},
            "cluster": {
                "type": "integer",
                "minimum": 0,
                "description": "Of files in places far from each other, the number of the place to build; 0 is the largest.",
            },
            "style": {
                "type": "object",
                "additionalProperties": False,
                "required": ["rules"],
                "description": "Colours of surfaces to which the files give none, as in a style file.",
                "properties": {"rules": {"type": "array", "maxItems": 1000, "items": {"type": "object"}}},
            },
        },
    },
    "render": {
        "type": "object",
        "additionalProperties": False,
        "description": "Builds the scene if its files have changed, then renders the missing and changed tiles.",
        "properties": {
            "workers": _WORKERS,
            "max_memory_bytes": _MEMORY,
            "retry_quarantined": {"type": "boolean", "description": "Renders the blocks in quarantine once more."},
        },
    },
    "publish": {
        "type": "object",
        "additionalProperties": False,
        "description": "Writes the rendering as static files, or updates them.",
        "properties": {
            "folder": {
                "type": "string",
                "pattern": FOLDER_NAME,
                "description": "Name of the folder in the workspace's folder published/; by default that of the rendering.",
            },
            "url": {"type": "string", "description": "Address of the map's page, which links to it need to show its picture."},
            "allow_incomplete": {"type": "boolean", "description": "Publish even if blocks are missing."},
        },
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
            "with_renderings": {"type": "boolean", "description": "scene: removes its renderings too."},
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
