"""The options that select layers, shared by create-rendering and add-layers."""

from collections.abc import Callable
from datetime import date, datetime
from functools import wraps
from typing import Any, Final, cast

import click

from map3d.cli.options import Command
from map3d.geometry.sun import GeographicPosition, SunAngles
from map3d.renderings.layers import LayerRequest, choose_layers
from map3d.renderings.sun_layers import RADIUS_M as DEFAULT_RADIUS_M
from map3d.renderings.sun_layers import LightRequest
from map3d.types import AO_RADIUS_M, COLOR_FORMATS, DEFAULT_DATA, LAYER_KINDS, LAYERS_BY_DATA, DataEncoding


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


class Pair(click.ParamType):  # type: ignore[type-arg]
    """Two numbers separated by a comma."""

    def __init__(self, name: str, example: str, of: Callable[[float, float], Any]) -> None:
        self.name, self._example, self._of = name, example, of

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if isinstance(value, tuple):
            return value
        try:
            first, second = (float(part) for part in str(value).split(","))
        except ValueError:
            self.fail(f"{value!r} is not {self.name.upper()}; write two numbers in degrees, e.g. {self._example}", param, ctx)
        return self._of(first, second)


def layer_options(*, required: bool = False) -> Callable[[Command], Command]:
    """Adds `--layers` and its related options, passed together as a LayerRequest `layers`. Unless `--layers` is required, also `--data`."""

    def add(command: Command) -> Command:
        @wraps(command)
        def gathered(*args: Any, layers: str | None, color: str, quality: int, small: bool, data: DataEncoding | None = None, **rest: Any) -> Any:
            given = None if layers is None else tuple(part.strip() for part in layers.split(",") if part.strip())
            names = choose_layers(given, data)
            light = LightRequest(**{name: rest.pop(name) for name in ("time", "sun", "day", "radius_m", "place")})
            return command(*args, layers=LayerRequest(names, color, quality, light, small), **rest)

        for option in reversed([_layers_option(required=required), *([] if required else [data_option(beside_layers=True)]), *_OPTIONS]):
            gathered = option(gathered)
        return cast(Command, gathered)

    return add


def _layers_option(*, required: bool) -> Callable[[Any], Any]:
    text = f"Comma-separated layers, each KIND or NAME=KIND. Kinds: {', '.join(LAYER_KINDS)}."
    return click.option("--layers", required=required, help=text if required else f"{text}  [default: {','.join(LAYERS_BY_DATA[DEFAULT_DATA])}]")


def data_option(*, beside_layers: bool = False) -> Callable[[Any], Any]:
    """Adds `--data`; None unless it is given, if it stands beside `--layers`, else by default DEFAULT_DATA."""
    stores = "tore normal, id and depth as one layer of data tiles (tile), or in more than twice the bytes as three PNG layers, which any program"
    stores += " reads (png)."
    text = f"Instead of --layers: s{stores}  [default: {DEFAULT_DATA}]" if beside_layers else f"S{stores}"
    settings: dict[str, Any] = {} if beside_layers else {"default": DEFAULT_DATA, "show_default": True}
    return click.option("--data", type=click.Choice(list(LAYERS_BY_DATA)), help=text, **settings)


small_option: Final = click.option("--small", is_flag=True, help="Encode for size: about 30 % fewer bytes, in three times the encoding time.")

_OPTIONS: list[Callable[[Any], Any]] = [
    click.option(
        "--color", type=click.Choice(list(COLOR_FORMATS)), default="webp", show_default=True, help="Image format of the layers color and picture."
    ),
    click.option("--quality", type=click.IntRange(1, 100), default=80, show_default=True, help="Quality of webp and jpeg."),
    small_option,
    click.option("--time", type=IsoTime(), help="Layers sun and picture: date and time with time zone, e.g. 2026-06-21T15:00+02:00."),
    click.option(
        "--sun",
        type=Pair("azimuth,elevation", "195,60", SunAngles),
        help="Layers sun and picture, instead of --time: the sun's azimuth clockwise from true north and its elevation, in degrees.",
    ),
    click.option(
        "--date",
        "day",
        type=IsoDate(),
        help="Layer sun16: the day; one sun per hour from 5 to 20, local zone time.",
    ),
    click.option(
        "--ao-radius",
        "radius_m",
        type=click.FloatRange(*AO_RADIUS_M),
        help=f"Layers ao and picture: radius of ambient occlusion in metres.  [default: {DEFAULT_RADIUS_M:g}]",
    ),
    click.option(
        "--place",
        type=Pair("latitude,longitude", "48.76,11.42", GeographicPosition),
        help="Sun layers of a scene in local metres: its position on earth, in degrees; the y axis points north.",
    ),
]
