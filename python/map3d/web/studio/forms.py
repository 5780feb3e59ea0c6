"""Forms made from requests (map3d.requests): the fields that a template does not write by hand, and the JSON values of what a user sends."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

from map3d.errors import BadRequest
from map3d.quantities import parse_size
from map3d.requests import AddFiles, ChangeRendering, CreateRendering, CreateScene, Publish
from map3d.requests.json_values import schemas_of
from map3d.requests.param import RequestField, fields_of

FORMS: Final[Mapping[type, Collection[str]]] = {
    AddFiles: ("crs", "up", "split", "lod", "theme", "interiors", "transparency"),
    CreateScene: ("name", "title", "attribution", "crs", "ground_plane"),
    CreateRendering: ("name", "title", "directions", "pitch", "res_m", "layers", "data", "time", "day"),
    ChangeRendering: ("title", "attribution", "description", "start_view"),
    Publish: ("folder",),
}
"""Request → fields that the template of its form writes by hand. The others follow under "More options"."""
_YES: Final = "yes"


def more_fields(request: type) -> list[RequestField]:
    """Returns the fields of a form under "More options"."""
    return [one for one in fields_of(request).values() if one.is_on("studio") and one.name not in FORMS[request]]


def more_controls(request: type, fields: Any) -> list[dict[str, Any]]:
    """Returns the controls of `more_fields`, with the values that the user sent."""
    return [_control(one, _sent(one, fields)) for one in more_fields(request)]


def more_values(request: type, fields: Any) -> dict[str, Any]:
    """Returns the values of `more_fields` that the user sent. Raises BadRequest."""
    return read_values(request, more_fields(request), fields)


def form_values(request: type, fields: Any) -> dict[str, Any]:
    """Returns the values of all fields that the user sent. Raises BadRequest."""
    return read_values(request, [one for one in fields_of(request).values() if one.is_on("studio")], fields)


def read_values(request: type, known: Sequence[RequestField], fields: Any) -> dict[str, Any]:
    """Returns the values as the REST API takes them, without those that the user left empty. Raises BadRequest."""
    schemas = schemas_of(request)
    texts = [(one, _sent(one, fields)) for one in known]
    return {one.rest: _value(one, text, schemas[one.rest]) for one, text in texts if text}


def _sent(one: RequestField, fields: Any) -> str:
    """Returns what the user sent. A switch sends "no", and "yes" after it if it is on."""
    texts: list[str] = fields.getlist(one.rest)
    return texts[-1].strip() if texts else ""


def _control(one: RequestField, sent: str) -> dict[str, Any]:
    """`options`: of a selection; other fields are switches, numbers or text."""
    known = one.param
    default = ("no", _YES)[one.value] if one.kind is bool else "" if one.value is None or known.default else str(one.value)
    step = None if known.is_size else {int: "1", float: "any"}.get(one.kind)
    control = {"name": one.rest, "label": known.label, "is_switch": one.kind is bool, "options": [str(choice) for choice in known.choices]}
    hints = {"placeholder": known.default or known.example, "step": step, "min": known.minimum, "max": known.maximum}
    return {**control, **hints, "value": sent or default, "is_changed": sent not in ("", default)}


def _value(one: RequestField, text: str, schema: Mapping[str, Any]) -> Any:
    if one.kind is bool:
        return text == _YES
    if one.param.choices:
        return _choice(one, text)
    if one.param.is_size:
        size = parse_size(text)
        if size is None:
            raise BadRequest(f"{one.rest} is {text[:40]!r}, expected a size such as 512M or 2G")
        return size
    if one.kind == tuple[str, ...]:
        return [part.strip() for part in text.split(",") if part.strip()]
    if schema["type"] in ("integer", "number"):
        return _number(one, text, whole=schema["type"] == "integer")
    return _numbers(one, text, schema.get("minItems", 0)) if schema["type"] == "array" else text


def _numbers(one: RequestField, text: str, count: int) -> list[float]:
    numbers = [_number(one, part, whole=False) for part in text.replace(",", " ").split()]
    if len(numbers) != count:
        raise BadRequest(f"{one.rest} is {text[:40]!r}, expected {count} numbers, e.g. {one.param.example}")
    return numbers


def _choice(one: RequestField, text: str) -> Any:
    for choice in one.param.choices:
        if str(choice) == text:
            return choice
    raise BadRequest(f"{one.rest} is {text[:40]!r}, expected {' or '.join(map(str, one.param.choices))}")


def _number(one: RequestField, text: str, *, whole: bool) -> float:
    least, most = one.param.minimum, one.param.maximum
    try:
        value = (int if whole else float)(text if text.isascii() else "")
        if (least is None or value >= least) and (most is None or value <= most):
            return value
    except ValueError:
        pass
    limits = "" if least is None else f" from {least:g}" + ("" if most is None else f" to {most:g}")
    raise BadRequest(f"{one.rest} is {text[:40]!r}, expected a {'whole ' if whole else ''}number{limits}")
