"""The form of a new rendering, and the query of a preview."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import date, datetime
from typing import Any, Final

from map3d.catalogue import SceneRecord
from map3d.errors import BadRequest
from map3d.geometry.sun import SunAngles
from map3d.geometry.views import check_angles
from map3d.renderings.layers import make_layers
from map3d.renderings.sun_layers import ONE_SUN
from map3d.requests import CreateRendering, LayerDetails
from map3d.requests.json_values import from_json
from map3d.types import DATA_TILE_KINDS, DEFAULT_DATA, LAYER_KINDS, LAYERS_BY_DATA, Box, DataEncoding, Layer, LayerKind, ViewAngles
from map3d.web.studio.forms import more_values

DEFAULT_RES_M: Final = 0.2
_SUN: Final = SunAngles(160.0, 45.0)
"""Azimuth and elevation of the sun in previews."""


@dataclass(frozen=True)
class RenderingForm:
    """The fields as the user left them; `request` checks them. `layers` never has the kind data: `data` says how normal, id and depth are stored.
    `res_m`: None for a number of levels, which is in `more`, as the REST API takes it. `problem`: what is wrong with the first field that cannot be
    read, which has its default here; empty if there is none."""

    name: str
    title: str
    directions: int
    pitch_deg: float
    res_m: float | None
    layers: tuple[LayerKind, ...]
    data: DataEncoding
    time: str
    day: str
    more: Mapping[str, Any] = field(default_factory=dict)
    problem: str = ""

    def request(self, scene: str, name: str) -> CreateRendering:
        """Raises BadRequest."""
        if self.problem:
            raise BadRequest(self.problem)
        values = {"scene": scene, "name": name, "title": self.title, "directions": self.directions, "pitch": self.pitch_deg, **self.more}
        return from_json(CreateRendering, values, res_m=self.res_m, layers=self.stored_layers, **self._light())

    @property
    def stored_layers(self) -> tuple[LayerKind, ...]:
        """The kinds to render: one layer of data tiles for those of normal, id and depth that are chosen, if `data` says so."""
        if self.data == "png":
            return self.layers
        return tuple(dict.fromkeys("data" if kind in DATA_TILE_KINDS else kind for kind in self.layers))

    def _light(self) -> dict[str, Any]:
        one, whole = "sun" not in self.more and any(kind in self.layers for kind in ONE_SUN), "sun16" in self.layers
        try:
            time = datetime.fromisoformat(self.time + ("+00:00" if "+" not in self.time and "Z" not in self.time else "")) if one else None
            day = date.fromisoformat(self.day) if whole else None
        except ValueError as error:
            raise BadRequest("the layers sun, picture and sun16 need a date and a time of the sun") from error
        return {"time": time, "day": day}


@dataclass(frozen=True)
class PreviewQuery:
    """`res_m`: None for a picture of the whole scene; `at`: centre of the part, as shares of that picture."""

    view: ViewAngles
    kind: str
    res_m: float | None
    at: tuple[float, float] | None

    def layer(self, scene: SceneRecord, box: Box) -> Layer:
        """Raises BadRequest."""
        return make_layers((self.kind,), LayerDetails(sun=_SUN if self.kind in ONE_SUN else None), scene, box)[0]


def read_form(fields: Any) -> RenderingForm:
    """Reads a form or query; missing fields, and those that cannot be read, get their defaults."""
    layers = tuple(kind for kind in LAYER_KINDS if kind in fields.getlist("layer") and kind != "data") or LAYERS_BY_DATA["png"]
    data, problems = fields.get("data"), _Problems()
    more = problems.without(lambda: more_values(CreateRendering, fields), {})
    res_m = None if "levels" in more else problems.without(lambda: _number(fields, "res", DEFAULT_RES_M, 0.001, 1e6), DEFAULT_RES_M)
    return RenderingForm(
        name=fields.get("name", "").strip(),
        title=fields.get("title", "").strip(),
        directions=round(problems.without(lambda: _number(fields, "directions", 4, 1, 360), 4)),
        pitch_deg=problems.without(lambda: _number(fields, "pitch", 45, 1, 90), 45),
        res_m=res_m,
        layers=layers,
        data=data if data in LAYERS_BY_DATA else DEFAULT_DATA,
        time=fields.get("time", "").strip(),
        day=fields.get("day", "").strip(),
        more=more,
        problem=problems.first,
    )


class _Problems:
    """Remembers the first problem of several reads."""

    first = ""

    def without(self, read: Callable[[], Any], default: Any) -> Any:
        """Returns what `read` returns, or the default if it raises BadRequest."""
        try:
            return read()
        except BadRequest as error:
            self.first = self.first or str(error)
            return default


def read_preview(fields: Mapping[str, str]) -> PreviewQuery:
    """Raises BadRequest."""
    kind = fields.get("kind", "color")
    if kind not in LAYER_KINDS or kind in ("data", "sun16"):
        raise BadRequest(f"layer {kind[:40]!r}: has no preview")
    view = ViewAngles(_number(fields, "look", 0, 0, 359.999), _number(fields, "pitch", 45, 1, 90))
    check_angles(view)
    at = (_number(fields, "x", 0.5, 0, 1), _number(fields, "y", 0.5, 0, 1)) if "x" in fields and "y" in fields else None
    res_m = _number(fields, "res", 1, 0.001, 1e6) if "res" in fields else None
    return PreviewQuery(view, kind, res_m, at)


def _number(fields: Mapping[str, str], name: str, default: float, least: float, greatest: float) -> float:
    text = fields.get(name, "").strip()
    try:
        value = float(text) if text and text.isascii() else default if not text else math.nan
    except ValueError:
        value = math.nan
    if not least <= value <= greatest:
        raise BadRequest(f"{name} is {text[:40]!r}, expected a number from {least:g} to {greatest:g}")
    return value
