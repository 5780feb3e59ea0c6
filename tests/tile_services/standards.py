"""The published schemas of the standards, which are not part of the repository."""

import json
import os
from functools import lru_cache
from pathlib import Path

import pytest
from jsonschema import Draft201909Validator
from referencing import Registry, Resource
from referencing.jsonschema import DRAFT201909

FOLDERS = (Path(os.environ.get("MAP3D_STANDARDS", "../shared/standards")), Path("../../shared/standards"))


@lru_cache
def standards() -> Path:
    """Returns the folder of the standards; skips the test without it."""
    for folder in FOLDERS:
        if folder.is_dir():
            return folder.resolve()
    pytest.skip("the OGC schemas are not there: set MAP3D_STANDARDS to a folder with tms-2.0/*.json and ogcapi-tiles-1.bundled.json")


def check_tms(value, name):
    """Validates against a schema of the Two Dimensional Tile Matrix Set standard 2.0."""
    folder = standards() / "tms-2.0"
    schemas = {path.name: json.loads(path.read_text()) for path in folder.glob("*.json")}
    registry = Registry().with_resources((name, Resource(row, DRAFT201909)) for name, row in schemas.items() if "tiles" not in name)
    _validate(value, {"$ref": name}, registry)


def check_ogcapi(value, name):
    """Validates against a schema of OGC API – Tiles."""
    document = json.loads((standards() / "ogcapi-tiles-1.bundled.json").read_text())
    _validate(value, {"$ref": f"#/components/schemas/{name}", "components": document["components"]}, Registry())


def _validate(value, schema, registry):
    errors = sorted(Draft201909Validator(schema, registry=registry).iter_errors(value), key=lambda error: list(map(str, error.path)))
    assert not errors, [f"{list(error.path)}: {error.message:.200}" for error in errors]
