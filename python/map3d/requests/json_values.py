"""Requests as JSON: their schemas, in the subset that OpenAPI 3.0 and JSON Schema share, and the requests that JSON values mean."""

from collections.abc import Callable, Mapping
from datetime import date, datetime
from typing import Any, Final, NamedTuple, TypeVar

from map3d.errors import BadRequest
from map3d.geometry.sun import GeographicPosition, SunAngles
from map3d.requests.param import RequestField, fields_of, help_text
from map3d.requests.reading import ModelOffset
from map3d.requests.renderings import Window
from map3d.requests.scenes import Style
from map3d.types import ViewAngles

Request = TypeVar("Request")

_NUMBER: Final = {"type": "number"}


class _Kind(NamedTuple):
    """`read` makes the value of a field from its JSON value."""

    schema: Mapping[str, Any]
    read: Callable[[Any], Any] = lambda value: value


def _numbers(count: int) -> dict[str, Any]:
    return {"type": "array", "items": _NUMBER, "minItems": count, "maxItems": count}


def _texts(items: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": dict(items)}


_KINDS: Final[Mapping[Any, _Kind]] = {
    str: _Kind({"type": "string"}),
    bool: _Kind({"type": "boolean"}),
    int: _Kind({"type": "integer"}),
    float: _Kind(_NUMBER, float),
    date: _Kind({"type": "string", "format": "date"}, date.fromisoformat),
    datetime: _Kind({"type": "string", "format": "date-time"}, datetime.fromisoformat),
    SunAngles: _Kind(_numbers(2), lambda value: SunAngles(*value)),
    GeographicPosition: _Kind(_numbers(2), lambda value: GeographicPosition(*value)),
    Window: _Kind(_numbers(3), tuple),
    ModelOffset: _Kind(_numbers(3), lambda value: ModelOffset(*value)),
    tuple[str, ...]: _Kind(_texts({"type": "string"}), tuple),
    tuple[float, ...]: _Kind({"anyOf": [_NUMBER, _texts(_NUMBER)]}, lambda value: tuple(value) if isinstance(value, list) else (float(value),)),
    tuple[ViewAngles, ...]: _Kind(_texts(_numbers(2)), lambda value: tuple(ViewAngles(*view) for view in value)),
    ViewAngles: _Kind(_numbers(2), lambda value: ViewAngles(*value)),
    Style: _Kind(
        {
            "type": "object",
            "additionalProperties": False,
            "required": ["rules"],
            "properties": {"rules": _texts({"type": "object"}) | {"maxItems": 1_000}},
        }
    ),
}


def schemas_of(request: type) -> dict[str, Any]:
    """Returns name → schema of the fields that the REST API has."""
    return {one.rest: _schema(request, one) for one in fields_of(request).values() if one.is_on("rest")}


def from_json(request: type[Request], values: Mapping[str, Any], **more: Any) -> Request:
    """Returns the request of values that its schemas allow; `more` are fields that do not come from JSON. Raises BadRequest."""
    known = {one.rest: one for one in fields_of(request).values() if one.is_on("rest")}
    found = {}
    for name, value in values.items():
        one = known[name]
        try:
            found[one.name] = _kind(one).read(value)
        except ValueError as error:
            raise BadRequest(f"{name}: {error}; write e.g. {_EXAMPLES.get(one.kind, 'a number')}") from None
    return request(**found, **more)


_EXAMPLES: Final = {datetime: "2026-06-21T15:00+02:00", date: "2026-06-21"}


def _kind(one: RequestField) -> _Kind:
    if one.param.choices:
        return _KINDS[type(one.param.choices[0])]
    return _KINDS[one.kind]


def _schema(request: type, one: RequestField) -> dict[str, Any]:
    known, words = one.param, one.param.default
    schema: dict[str, Any] = {**_kind(one).schema, "description": help_text(request, one.name, "rest") + (f" By default {words}." if words else "")}
    if known.choices:
        schema["enum"] = list(known.choices)
    if known.pattern and "items" in schema:
        schema["items"] = {**schema["items"], "pattern": known.pattern}
    elif known.pattern:
        schema["pattern"] = known.pattern
    least, most = ("minItems", "maxItems") if schema.get("type") == "array" else ("minimum", "maximum")
    schema |= {name: limit for name, limit in ((least, known.minimum), (most, known.maximum)) if limit is not None}
    return schema if words or one.value in (None, "", ()) else {**schema, "default": one.value}
