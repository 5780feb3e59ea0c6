"""Declares routes of the REST API: one declaration makes the route and its part of the OpenAPI document, so that they cannot differ."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, wraps
from typing import Any, Final

from starlette.responses import Response

from map3d.catalogue import Role
from map3d.errors import BadRequest
from map3d.operations.arguments import place_of
from map3d.web.api.schemas import SCHEMAS, ref
from map3d.web.http.current import request
from map3d.web.http.guards import requires
from map3d.web.http.responses import json_value
from map3d.web.http.routes import Routes

PREFIX: Final = "/api/v1"
MAX_BODY_BYTES: Final = 1 << 20
"""More than forms have: an import of many files names each."""
MAX_PAGE: Final = 1_000
_WHOLE: Final = re.compile(r"0|[1-9][0-9]{0,14}", re.ASCII)

api: Final = Routes("api", PREFIX)


@dataclass(frozen=True)
class Query:
    """A parameter of the query: a whole number from 0 to `most`, or text without it."""

    name: str
    about: str
    most: int | None = None
    least: int = 0

    def schema(self) -> dict[str, Any]:
        return {"type": "string"} if self.most is None else {"type": "integer", "minimum": self.least, "maximum": self.most}


@dataclass(frozen=True)
class ApiRoute:
    """`answer`, `body`: names of schemas. `role`: None for a public read."""

    method: str
    path: str
    about: str
    answer: str
    role: Role | None = None
    status: int = 200
    body: str | None = None
    query: tuple[Query, ...] = ()
    name: str = ""

    @property
    def parameters(self) -> list[str]:
        return re.findall(r"{(\w+)}", self.path)


ROUTES: Final[list[ApiRoute]] = []

LIMIT: Final = Query("limit", "Length of the page.", MAX_PAGE, 1)


View = Callable[..., Any]


def route(method: str, path: str, about: str, answer: str, *, role: Role | None = None, **more: Any) -> Callable[[View], View]:
    """Registers a view function. It gets the path's parameters, the query's (None where they are absent) and `body`, and returns the answer's value,
    or a pair of it and headers. Checks role, parameters and body first."""

    def register(view: View) -> View:
        declared = ApiRoute(method, path, about, answer, role, name=view.__name__, **more)
        ROUTES.append(declared)

        @wraps(view)
        def answered(**parameters: str) -> Response:
            given: dict[str, Any] = {**parameters, **_query(declared)}
            if declared.body is not None:
                given["body"] = _body(declared.body)
            found = view(**given)
            value, headers = found if isinstance(found, tuple) else (found, {})
            return json_value(value, declared.status, headers)

        api.add(method, path, answered if role is None else requires(role)(answered), MAX_BODY_BYTES)
        return view

    return register


def _query(declared: ApiRoute) -> dict[str, Any]:
    """Raises BadRequest for unknown, repeated and malformed parameters."""
    known, asked = {query.name: query for query in declared.query}, request().query_params
    for name in asked:
        if name not in known:
            raise BadRequest(f"unknown parameter {name[:64]!r}; known are {', '.join(known) or 'none'}")
        if len(asked.getlist(name)) > 1:
            raise BadRequest(f"parameter {name} is given twice")
    return {name: _parse(query, asked.get(name)) for name, query in known.items()}


def _parse(query: Query, text: str | None) -> Any:
    if text is None or query.most is None:
        return text
    if not _WHOLE.fullmatch(text) or not query.least <= int(text) <= query.most:
        raise BadRequest(f"parameter {query.name}={text[:64]!r}: expected a whole number from {query.least} to {query.most}")
    return int(text)


def _body(schema: str) -> Any:
    """Returns the JSON body. Raises BadRequest."""
    value = request().json()
    if not isinstance(value, Mapping):
        raise BadRequest("expected a JSON object with Content-Type: application/json")
    error = next(_validator(schema).iter_errors(value), None)
    if error is not None:
        raise BadRequest(f"the body{place_of(error)}: {error.message[:300]}")
    return value


@cache
def _validator(schema: str) -> Any:
    from jsonschema import Draft202012Validator

    return Draft202012Validator({**ref(schema), "components": {"schemas": SCHEMAS}})
