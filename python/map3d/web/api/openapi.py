"""The OpenAPI 3.0 document of the REST API, made from the declarations of its routes, and its error documents."""

from collections.abc import Mapping
from http import HTTPStatus
from typing import Any, Final

from starlette.responses import Response

from map3d import __version__
from map3d.errors import BadName, Map3dError, NotFound
from map3d.web.api.declare_route import PREFIX, ROUTES, ApiRoute
from map3d.web.api.schemas import SCHEMAS, ref
from map3d.web.http.current import request
from map3d.web.http.host_folders import without_host_folders
from map3d.web.http.public_url import public_url
from map3d.web.http.responses import json_value

PROBLEM_TYPE: Final = "application/problem+json"
_ABOUT: Final = """Scenes, imported files, renderings and operations. Long work is an operation: ask for it, then read its progress and log.
Files are uploaded to /uploads/ by the tus protocol (https://tus.io); an operation of the kind import takes the ids of uploads.
Send a token as `Authorization: Bearer TOKEN`; reads need the role viewer, writes the role editor. Answers are never cached."""


def openapi_document() -> dict[str, Any]:
    paths: dict[str, dict[str, Any]] = {}
    for declared in ROUTES:
        paths.setdefault(declared.path, {})[declared.method.lower()] = _operation(declared)
    return {
        "openapi": "3.0.3",
        "info": {"title": "map3d", "version": __version__, "description": _ABOUT, "license": {"name": "Apache-2.0"}},
        "servers": [{"url": public_url(PREFIX)}],
        "paths": paths,
        "components": {
            "schemas": {**SCHEMAS, "OpenApi": {"type": "object"}},
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    }


def _operation(declared: ApiRoute) -> dict[str, Any]:
    parameters = [{"name": name, "in": "path", "required": True, "schema": {"type": "string"}} for name in declared.parameters]
    parameters += [{"name": query.name, "in": "query", "description": query.about, "schema": query.schema()} for query in declared.query]
    answer = {"description": HTTPStatus(declared.status).phrase, "content": {"application/json": {"schema": ref(declared.answer)}}}
    problem = {"description": "An error.", "content": {PROBLEM_TYPE: {"schema": ref("Problem")}}}
    described: dict[str, Any] = {
        "operationId": declared.name,
        "summary": declared.about,
        "parameters": parameters,
        "responses": {str(declared.status): answer, "default": problem},
    }
    if declared.body is not None:
        described["requestBody"] = {"required": True, "content": {"application/json": {"schema": ref(declared.body)}}}
    if declared.role is not None:
        described |= {"security": [{"token": []}], "description": f"Needs the role {declared.role}."}
    return described


def problem_response(error: Exception, status: int, detail: str, headers: Mapping[str, str]) -> Response:
    """Returns an error as RFC 9457 describes it. A caller with an account reads what exists instead, and a wrong name in a body is a bad request."""
    asked = request()
    if isinstance(error, BadName) and asked["method"] == "POST":
        status, detail = 400, without_host_folders(str(error))
    elif isinstance(error, NotFound) and "authorization" in asked.headers and asked.caller.identity is not None:
        detail = without_host_folders(str(error))
    value = {"type": "about:blank", "title": HTTPStatus(status).phrase, "status": status, "detail": detail}
    if isinstance(error, Map3dError) and error.message.code != "verbatim":
        said = error.message.map_texts(without_host_folders)
        value |= said.document if str(said) == detail else {}
    return json_value(value, status, {**headers, "Content-Type": PROBLEM_TYPE})
