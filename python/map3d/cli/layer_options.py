"""The options that say which layers, shared by the verbs that make some."""

from collections.abc import Callable, Sequence
from datetime import date, datetime
from functools import wraps
from typing import Any, cast

import click

from map3d.cli.options import Command
from map3d.geometry.sun import Place, SunAngles
from map3d.renderings.layers import LayerRequest
from map3d.renderings.sun_layers import RADIUS_M as USUAL_RADIUS_M
from map3d.renderings.sun_layers import LightRequest
from map3d.types import COLOR_FORMATS, DEFAULT_LAYERS, LAYER_KINDS, RADIUS_M


class IsoTime(click.ParamType):  # type: ignore[type-arg]
    """Date and time as in ISO 8601."""

    name = "time"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> datetime:
        try:
            return value if isinstance(value, datetime) else datetime.fromisoformat(str(value))
        except ValueError:
            self.fail(f"{value!r} is not a date and time; write it like 2026-06-21T15:00+02:00, or 2026-06-21T13:00Z", param, ctx)


class IsoDate(click.ParamType):  # type: ignore[type-arg]
    """YYYY-MM-DD."""

    name = "date"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> date:
        try:
            return value if isinstance(value, date) else date.fromisoformat(str(value))
        except ValueError:
            self.fail(f"{value!r} is not a date; write it like 2026-06-21", param, ctx)


class Pair(click.ParamType):  # type: ignore[type-arg]
    """Two numbers with a comma between."""

    def __init__(self, name: str, example: str, of: Callable[[float, float], Any]) -> None:
        self.name, self._example, self._of = name, example, of

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if isinstance(value, tuple):
            return value
        try:
            first, second = (float(part) for part in str(value).split(","))
        except ValueError:
            self.fail(f"{value!r} is not {self.name.upper()}; write two numbers of degrees, e.g. {self._example}", param, ctx)
        return self._of(first, second)


def layer_options(*, default: Sequence[str] = DEFAULT_LAYERS) -> Callable[[Command], Command]:
    """`--layers` and what goes with it: passed together as `layers`, a LayerRequest. Without a `default`, `--layers` is required."""

    def add(command: Command) -> Command:
        @wraps(command)
        def gathered(*args: Any, layers: str, color: str, quality: int, small: bool, **rest: Any) -> Any:
            names = tuple(part.strip() for part in layers.split(",") if part.strip())
            light = LightRequest(**{name: rest.pop(name) for name in ("time", "sun", "day", "radius_m", "place")})
            return command(*args, layers=LayerRequest(names, color, quality, light, small), **rest)

        for option in reversed([_layers_option(default), *_OPTIONS]):
            gathered = option(gathered)
        return cast(Command, gathered)

    return add


def _layers_option(default: Sequence[str]) -> Callable[[Any], Any]:
    settings: dict[str, Any] = {"default": ",".join(default), "show_default": True} if default else {"required": True}
    text = f"Which layers: KIND or NAME=KIND, with commas between. Kinds: {', '.join(LAYER_KINDS)}."
    return click.option("--layers", help=text, **settings)


_OPTIONS: list[Callable[[Any], Any]] = [
    click.option(
        "--color", type=click.Choice(list(COLOR_FORMATS)), default="webp", show_default=True, help="Format of the layers color and picture."
    ),
    click.option("--quality", type=click.IntRange(1, 100), default=80, show_default=True, help="Of webp and jpeg."),
    click.option("--small", is_flag=True, help="Take three times as long to encode, for two fifths fewer bytes; tiles show the same."),
    click.option("--time", type=IsoTime(), help="Layers sun and picture: when, with the zone, e.g. 2026-06-21T15:00+02:00."),
    click.option(
        "--sun",
        type=Pair("azimuth,elevation", "195,60", SunAngles),
        help="Layers sun and picture, instead of --time: where the sun stands, in degrees clockwise from true north and above the horizon.",
    ),
    click.option("--date", "day", type=IsoDate(), help="Layer sun16: the day, whose full hours from 5 to 20 it has, in the place's own zone."),
    click.option(
        "--ao-radius",
        "radius_m",
        type=click.FloatRange(*RADIUS_M),
        help=f"Layers ao and picture: metres up to which things around take light away.  [default: {USUAL_RADIUS_M:g}]",
    ),
    click.option(
        "--place",
        type=Pair("latitude,longitude", "48.76,11.42", Place),
        help="Layers of the sun, in a scene of local metres: where on earth it lies, in degrees; its y axis points north.",
    ),
]
