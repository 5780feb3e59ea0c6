"""The types of the values of options."""

from collections.abc import Callable
from datetime import date, datetime
from pathlib import Path
from typing import Any

import click

from map3d.errors import BadRequest
from map3d.geometry.views import parse_view
from map3d.quantities import parse_size
from map3d.types import ViewAngles


class Bytes(click.ParamType):  # type: ignore[type-arg]
    """A number of bytes, e.g. 512M or 2G."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        size = value if isinstance(value, int) else parse_size(str(value))
        return self.fail(f"{value!r} is not a size; write e.g. 512M or 2G", param, ctx) if size is None else size


class View(click.ParamType):  # type: ignore[type-arg]
    """A look-at angle and a pitch in degrees, e.g. 45-22.5 or 45/22.5."""

    name = "view"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> ViewAngles:
        if isinstance(value, ViewAngles):
            return value
        try:
            return parse_view(str(value))
        except BadRequest as error:
            self.fail(str(error), param, ctx)


class StyleFile(click.ParamType):  # type: ignore[type-arg]
    """A style file, or "none": the content of the file."""

    name = "FILE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from map3d.scenes.style import read_style

        return {"rules": []} if value == "none" else value if isinstance(value, dict) else read_style(Path(value))


class IsoTime(click.ParamType):  # type: ignore[type-arg]
    """A date and time in ISO 8601."""

    name = "time"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> datetime:
        try:
            return value if isinstance(value, datetime) else datetime.fromisoformat(str(value))
        except ValueError:
            self.fail(f"{value!r} is not a date and time; write e.g. 2026-06-21T15:00+02:00 or 2026-06-21T13:00Z", param, ctx)


class IsoDate(click.ParamType):  # type: ignore[type-arg]
    """A date as YYYY-MM-DD."""

    name = "date"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> date:
        try:
            return value if isinstance(value, date) else date.fromisoformat(str(value))
        except ValueError:
            self.fail(f"{value!r} is not a date; write e.g. 2026-06-21", param, ctx)


class CommaList(click.ParamType):  # type: ignore[type-arg]
    """Words separated by commas."""

    name = "text"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, ...]:
        return value if isinstance(value, tuple) else tuple(part.strip() for part in str(value).split(",") if part.strip())


class Numbers(click.ParamType):  # type: ignore[type-arg]
    """Numbers separated by commas. `example` completes "write …"."""

    def __init__(self, name: str, example: str, of: Callable[..., Any]) -> None:
        self.name, self._example, self._of = name, example, of

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if isinstance(value, tuple):
            return value
        parts = str(value).split(",")
        try:
            numbers = [float(part) for part in parts]
        except ValueError:
            numbers = []
        if len(numbers) != len(self.name.split(",")):
            self.fail(f"{value!r} is not {self.name.upper()}; write {self._example}", param, ctx)
        return self._of(*numbers)
