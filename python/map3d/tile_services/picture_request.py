"""Parses the address of a picture of a view: `<x>,<y>,<zoom>,<look-at>[,<pitch>[,<height>]]/<width>x<height>[@2x].<png|jpg|webp>`.

The same picture has one canonical address, whatever way its numbers are written.
"""

import math
import re
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final

from map3d.errors import BadRequest, LimitExceeded
from map3d.geometry.views import uvd_from_local, view_id
from map3d.tile_services.daylight import light_at, parse_time, time_text
from map3d.tile_services.tile_formats import parse_suffix, suffix_of
from map3d.tile_services.tiled_view import NotOffered
from map3d.tiles.decode_tile import layer_with
from map3d.tiles.manifest import Manifest, ManifestView
from map3d.tiles.view_plane import reference_height_m
from map3d.types import COLOR_KINDS, ViewAngles

MAX_SIDE_PX: Final = 4096
MAX_PIXELS: Final = 16 << 20
ZOOMS_BEYOND: Final = 3
"""Levels that a picture may be above the top level or below the deepest."""
MAX_COORDINATE_M: Final = 1e8
MAX_ADDRESS: Final = 200
LIT: Final = "lit"
_NUMBER: Final = re.compile(r"-?(?:0|[1-9][0-9]{0,8})(?:\.[0-9]{1,9})?", re.ASCII)
_SIZE: Final = re.compile(r"([1-9][0-9]{0,4})x([1-9][0-9]{0,4})(@2x)?\.([a-z]{3,4})", re.ASCII)
_EXPECTED: Final = "<x>,<y>,<zoom>,<look-at>[,<pitch>[,<height>]]/<width>x<height>[@2x].<png|jpg|webp>"


@dataclass(frozen=True)
class PictureRequest:
    """A picture of a stored view. `centre`: world position at its centre; `zoom`: at a whole number, a pixel of that level is a pixel of the picture
    (two with `scale` 2); `size`: without `scale`; `style`: the name of a layer, or `lit`: colours in the light of
    `time`, by default in that of the viewer."""

    view: ManifestView
    centre: tuple[float, float, float]
    zoom: float
    size: tuple[int, int]
    scale: int
    media_type: str
    style: str
    time: datetime | None = None

    @property
    def pixels(self) -> tuple[int, int]:
        """Width and height of the image."""
        return self.size[0] * self.scale, self.size[1] * self.scale

    @property
    def pixel_m(self) -> float:
        """Side of a pixel of the image."""
        frame = self.view.frame
        return float(frame.size_m / (frame.tile_px * 2.0**self.zoom) / self.scale)

    def centre_uv(self, manifest: Manifest) -> tuple[float, float]:
        """Returns U and V of the centre."""
        local = [a - b for a, b in zip(self.centre, manifest.origin, strict=True)]
        u, v, _ = uvd_from_local(self.view.frame.axes, local)
        return float(u), float(v)

    @property
    def address(self) -> str:
        """The canonical address below the rendering's prefix, with the style as its query."""
        x, y, height = (_text(value, 2) for value in self.centre)
        angles = view_id(self.view.frame.angles).replace("-", ",")
        retina = "@2x" if self.scale == 2 else ""
        where = f"{x},{y},{_text(self.zoom, 4)},{angles},{height}"
        light = "" if self.time is None else f"&t={time_text(self.time)}"
        return f"{where}/{self.size[0]}x{self.size[1]}{retina}.{suffix_of(self.media_type)}?style={self.style}{light}"


def parse_picture(manifest: Manifest, where: str, size: str, style: str | None = None, time: str | None = None) -> PictureRequest:
    """Parses the two parts of an address. `style`, `time` of the light: None for the default.

    Raises BadRequest, LimitExceeded; NotOffered for a view or style that the rendering does not have.
    """
    if len(where) + len(size) > MAX_ADDRESS:
        raise BadRequest(f"the address has {len(where) + len(size)} characters; expected {_EXPECTED}")
    match = _SIZE.fullmatch(size)
    media_type = parse_suffix(match[4]) if match else None
    if match is None or media_type is None:
        raise BadRequest(f"{size[:70]!r} is not a size; expected <width>x<height>[@2x].<png|jpg|webp>")
    scale = 2 if match[3] else 1
    width, height = int(match[1]), int(match[2])
    _check_size(width * scale, height * scale)
    parts = where.split(",")
    if not 4 <= len(parts) <= 6:
        raise BadRequest(f"{where[:70]!r} has {len(parts)} parts; expected {_EXPECTED}")
    view = _find_view(manifest, parts[3], parts[4] if len(parts) > 4 else None)
    x, y = (_coordinate(text) for text in parts[:2])
    z = _coordinate(parts[5]) if len(parts) > 5 else round(reference_height_m(manifest), 2)
    chosen = _choose_style(manifest, style)
    at = None if time is None else parse_time(time)
    if at is not None and chosen != LIT:
        if style is not None:
            raise BadRequest(f"style {chosen!r} has no light; leave out t, or choose the style {LIT}")
        at = None
    if at is not None:
        light_at(manifest, at)
    return PictureRequest(view, (x, y, z), _parse_zoom(manifest, parts[2]), (width, height), scale, media_type, chosen, at)


def parse_link(manifest: Manifest, link: str, size: tuple[int, int], media_type: str) -> PictureRequest:
    """Parses the view of a link to the map, `<view>/<x>/<y>/<z>/<zoom>`, possibly with more parts, as a request for a picture of that view.

    `/t=<UTC time>` is the time of its light, ignored where the map ignores it. Raises BadRequest, NotOffered.
    """
    parts, more = link.split("/")[:5], link.split("/")[5:]
    if len(link) > MAX_ADDRESS or len(parts) < 5:
        raise BadRequest(f"{link[:70]!r} is not a view; expected <look-at>-<pitch>/<x>/<y>/<z>/<zoom>")
    look_at, _, pitch = parts[0].partition("-")
    where = ",".join((parts[1], parts[2], parts[4], look_at, pitch, parts[3]))
    found = parse_picture(manifest, where, f"{size[0]}x{size[1]}.{suffix_of(media_type)}")
    times = [part.removeprefix("t=") for part in more if part.startswith("t=")]
    if not times or found.style != LIT:
        return found
    try:
        time = parse_time(times[0])
        light_at(manifest, time)
    except BadRequest:
        return found
    return replace(found, time=time)


def _check_size(width: int, height: int) -> None:
    if max(width, height) > MAX_SIDE_PX or width * height > MAX_PIXELS:
        raise LimitExceeded(f"the picture has {width} × {height} pixels; at most {MAX_SIDE_PX:,} a side and {MAX_PIXELS:,} in all are allowed")


def _find_view(manifest: Manifest, look_at: str, pitch: str | None) -> ManifestView:
    """Returns the view with the angles; without a pitch, the first with the look-at angle."""
    a, p = _parse_number(look_at), None if pitch is None else _parse_number(pitch)
    for view in manifest.views:
        angles: ViewAngles = view.frame.angles
        if angles.look_at_deg == a and p in (None, angles.pitch_deg):
            return view
    views = ", ".join(view.frame.id for view in manifest.views[:64])
    raise NotOffered(f"rendering {manifest.name!r} has no view {look_at[:20]}{'' if pitch is None else '-' + pitch[:20]}; its views are {views}")


def _parse_zoom(manifest: Manifest, text: str) -> float:
    """Parses a zoom, or metres per pixel such as `0.5m`."""
    frame = manifest.views[0].frame
    if text.endswith("m"):
        metres = _parse_number(text[:-1])
        if metres <= 0:
            raise BadRequest(f"{text[:70]!r}: expected a positive number of metres per pixel")
        zoom = math.log2(frame.size_m / (frame.tile_px * metres))
    else:
        zoom = _parse_number(text)
    zoom = round(zoom, 4) + 0.0
    if not -ZOOMS_BEYOND <= zoom <= manifest.zmax + ZOOMS_BEYOND:
        raise BadRequest(f"zoom {zoom:g} is out of range; expected {-ZOOMS_BEYOND} to {manifest.zmax + ZOOMS_BEYOND}")
    return zoom


def _choose_style(manifest: Manifest, style: str | None) -> str:
    names = [layer.name for layer in manifest.layers if layer.kind in COLOR_KINDS]
    if not names:
        raise NotOffered(f"rendering {manifest.name!r} has no colour layer")
    can_be_lit = "color" in names and layer_with(manifest.layers, "normal") is not None
    styles = [LIT, *names] if can_be_lit else names
    if style is None:
        return LIT if can_be_lit else names[0]
    if style not in styles:
        raise NotOffered(f"rendering {manifest.name!r} has no style {style[:70]!r}; its styles are {', '.join(styles)}")
    return style


def _coordinate(text: str) -> float:
    value = round(_parse_number(text), 2) + 0.0
    if abs(value) > MAX_COORDINATE_M:
        raise BadRequest(f"{text[:30]}: a coordinate is at most {MAX_COORDINATE_M:.0f} m")
    return value


def _parse_number(text: str) -> float:
    """Parses a plain decimal number of ASCII digits: neither an exponent nor `NaN`."""
    if not _NUMBER.fullmatch(text):
        raise BadRequest(f"{text[:30]!r} is not a plain decimal number; expected {_EXPECTED}")
    return float(text)


def _text(value: float, digits: int) -> str:
    """Returns the shortest text of a rounded number."""
    text = f"{value:.{digits}f}"
    return (text.rstrip("0").rstrip(".") if "." in text else text) if float(text) else "0"
