"""Options of commands, made from the fields of requests (map3d.requests)."""

from collections.abc import Callable, Mapping
from datetime import date, datetime
from functools import wraps
from pathlib import Path
from typing import Any, Final, cast

import click

from map3d.cli.option_types import Bytes, CommaList, IsoDate, IsoTime, Numbers, StyleFile, View
from map3d.cli.options import Command
from map3d.geometry.sun import GeographicPosition, SunAngles
from map3d.requests.param import RequestField, fields_of, help_text
from map3d.requests.reading import ModelOffset
from map3d.requests.renderings import Window
from map3d.requests.scenes import Style
from map3d.types import ViewAngles

_TYPES: Final[Mapping[Any, Any]] = {
    str: str,
    bool: bool,
    int: int,
    float: float,
    Path: click.Path(path_type=Path),
    date: IsoDate(),
    datetime: IsoTime(),
    SunAngles: Numbers("azimuth,elevation", "two numbers in degrees, e.g. 195,60", SunAngles),
    GeographicPosition: Numbers("latitude,longitude", "two numbers in degrees, e.g. 48.76,11.42", GeographicPosition),
    Window: Numbers("x,y,size", "X,Y,SIZE in metres, e.g. 691000,5336000,2000", lambda x, y, size: (x, y, size)),
    ModelOffset: Numbers("x,y,z", "X,Y,Z, e.g. 691000,5336000,500", ModelOffset),
    Style: StyleFile(),
    ViewAngles: View(),
    tuple[str, ...]: CommaList(),
}
"""Type of a field → type of the option's value."""
_MANY: Final = {tuple[ViewAngles, ...]: ViewAngles, tuple[float, ...]: float}
"""Types of repeatable options → type of each."""
_HINTS: Final = {**dict.fromkeys(_MANY, "repeatable"), tuple[str, ...]: "separated by commas"}


def request_options(request: type, **settings: Mapping[str, Any]) -> Callable[[Command], Command]:
    """Adds the arguments and options of a request. The command gets the request in place of their values, as `request`. `settings`: field → settings
    of click that replace those of the field."""
    known = {name: one for name, one in fields_of(request).items() if one.is_on("cli")}

    def add(command: Command) -> Command:
        @wraps(command)
        def with_request(*args: Any, **values: Any) -> Any:
            return command(*args, request=request(**{name: values.pop(name) for name in known}), **values)

        for one in reversed(known.values()):
            with_request = _parameter(request, one, settings.get(one.name, {}))(with_request)
        return cast(Command, with_request)

    return add


def request_option(request: type, name: str, **settings: Any) -> Callable[[Command], Command]:
    """Adds the option of one field, whose value the command gets under the field's name."""
    return _parameter(request, fields_of(request)[name], settings)


def _parameter(request: type, one: RequestField, settings: Mapping[str, Any]) -> Callable[[Command], Command]:
    if one.param.argument:
        return click.argument(one.name, **{"type": _type(one), **settings})
    names = [one.option] if one.kind is bool else one.option.split("/")
    return click.option(*names, one.name, **{**_settings(request, one), **settings})


def _settings(request: type, one: RequestField) -> dict[str, Any]:
    text, words = help_text(request, one.name, "cli"), one.param.default
    if one.kind in _HINTS:
        text = f"{text.removesuffix('.')}; {_HINTS[one.kind]}."
    is_shown = not words and (one.value or (one.value is False and "/" in one.option)) not in (None, "", (), False)
    found: dict[str, Any] = {"help": f"{text}  [default: {words}]" if words else text, "required": one.required}
    if one.kind is bool and "/" not in one.option:
        return {**found, "is_flag": True}
    if one.kind not in _MANY and not one.required:
        found["default"] = one.value
    if one.param.metavar:
        found["metavar"] = one.param.metavar
    return {**found, "type": _type(one), "multiple": one.kind in _MANY, "show_default": is_shown}


def _type(one: RequestField) -> Any:
    kind, known = _MANY.get(one.kind, one.kind), one.param
    if known.choices:
        return click.Choice(list(known.choices))
    if known.is_size:
        return Bytes()
    if kind in (int, float) and (known.minimum, known.maximum) != (None, None):
        return (click.IntRange if kind is int else click.FloatRange)(known.minimum, known.maximum)
    return _TYPES[kind]
