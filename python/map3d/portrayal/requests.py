"""The requests of the service as values, checked against everything but the contents: names of layers, styles and coordinate systems."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from map3d.portrayal.image_formats import ImageFormat, ImageLayer, parse_format, parse_image_layer
from map3d.portrayal.parameters import Parameters, PortrayalText
from map3d.portrayal.projections import ProjectionRequest, parse_projection
from map3d.portrayal.scalars import Color, parse_color, parse_flag, parse_integer, parse_list, parse_number
from map3d.portrayal.service_exception import ServiceException, invalid, missing, quote

SERVICE: Final = "3DPS"
VERSIONS: Final = ("1.0", "1.0.0")
MAX_SIDE_PX: Final = 4096
MAX_PIXELS: Final = 16 << 20
SPATIAL_SELECTIONS: Final = ("overlaps", "contains_center", "cut")
LOD_SELECTIONS: Final = ("equals", "equals_or_smaller", "combined", "equals_or_similar")
MAX_LAYERS: Final = 256
MAX_FEATURES: Final = 1000


@dataclass(frozen=True)
class Portrayal:
    """One view: `qualities` are complete, 0 to 100."""

    width_px: int
    height_px: int
    projection: ProjectionRequest
    image_layers: tuple[ImageLayer, ...]
    formats: tuple[ImageFormat, ...]
    qualities: tuple[int, ...]


@dataclass(frozen=True)
class BoundingBox:
    """`low`, `high`: two or three coordinates in the axis order of `crs`."""

    crs: str
    low: tuple[float, ...]
    high: tuple[float, ...]


@dataclass(frozen=True)
class GetView:
    """`styles`, `lods`: one per layer, empty for the default one; empty lists if not requested. `background_color` is None unless requested."""

    crs: str
    layers: tuple[str, ...]
    portrayals: tuple[Portrayal, ...]
    bounding_box: BoundingBox | None
    spatial_selection: str
    styles: tuple[str, ...]
    lods: tuple[str, ...]
    lod_selection: str
    background: str | None
    background_color: Color | None
    transparent: bool
    overall_styles: tuple[str, ...]
    delivery_options: tuple[str, ...]
    sun: tuple[float, float] | None


@dataclass(frozen=True)
class InfoRequest:
    """What the three GetFeatureInfo operations share. `feature_count`: per layer, None for the default."""

    layers: tuple[str, ...]
    feature_count: int | None
    id_only: bool
    format: str


@dataclass(frozen=True)
class InfoByRay(InfoRequest):
    crs: str
    width_px: int
    height_px: int
    projection: ProjectionRequest
    x_px: int
    y_px: int


@dataclass(frozen=True)
class InfoByPosition(InfoRequest):
    """`tolerance_m`: None for the default."""

    crs: str
    position: tuple[float, float, float]
    tolerance_m: float | None


@dataclass(frozen=True)
class InfoByObjectId(InfoRequest):
    object_ids: tuple[int, ...]


INFO_FORMATS: Final = ("text/xml", "application/json", "text/html")
DEFAULT_FEATURES: Final = 1


def check_service(parameters: Parameters) -> None:
    """Checks the service parameter. Raises MissingParameterValue, InvalidParameterValue."""
    service = parameters.require("service")
    if service.upper() != SERVICE:
        raise invalid("service", f"{quote(service)}, expected {SERVICE}")


def check_version(parameters: Parameters) -> None:
    """Checks the version parameter, which all operations but GetCapabilities demand."""
    version = parameters.require("version")
    if version not in VERSIONS:
        raise invalid("version", f"{quote(version)}, expected {VERSIONS[0]}")


def parse_get_view(parameters: Parameters) -> GetView:
    """Raises ServiceException."""
    crs = parameters.require("crs")
    layers = _parse_layers(parameters)
    if not parameters.portrayals:
        raise missing("portrayals")
    color = parameters.non_empty("backgroundColor")
    transparent = parameters.non_empty("transparentBackground")
    return GetView(
        crs=crs,
        layers=layers,
        portrayals=tuple(_parse_portrayal(text) for text in parameters.portrayals),
        bounding_box=_parse_bounding_box(parameters, crs),
        spatial_selection=_choose(parameters, "spatialSelection", SPATIAL_SELECTIONS),
        styles=_parallel_list(parameters, "styles", layers),
        lods=_parallel_list(parameters, "lods", layers),
        lod_selection=_choose(parameters, "lodSelection", LOD_SELECTIONS),
        background=parameters.non_empty("background"),
        background_color=None if color is None else parse_color(color, "backgroundColor"),
        transparent=False if transparent is None else parse_flag(transparent, "transparentBackground"),
        overall_styles=tuple(filter(None, parse_list(parameters.get("overallStyles") or ""))),
        delivery_options=tuple(filter(None, parse_list(parameters.get("deliveryOptions") or ""))),
        sun=_parse_sun(parameters),
    )


def parse_info_by_ray(parameters: Parameters) -> InfoByRay:
    """Raises ServiceException."""
    shared = _parse_info(parameters)
    crs = parameters.require("crs")
    width = parse_integer(parameters.require("width"), "width", 1, MAX_SIDE_PX)
    height = parse_integer(parameters.require("height"), "height", 1, MAX_SIDE_PX)
    items = parameters.require("projection").split(",")
    projection = parse_projection([item.strip() for item in items], "projection")
    position = parse_list(parameters.require("imagePosition"))
    if len(position) != 2 or not all(position):
        raise invalid("imagePosition", f"{quote(','.join(position))}, expected x,y")
    x, y = parse_integer(position[0], "imagePosition", 0, width - 1), parse_integer(position[1], "imagePosition", 0, height - 1)
    return InfoByRay(**vars(shared), crs=crs, width_px=width, height_px=height, projection=projection, x_px=x, y_px=y)


def parse_info_by_position(parameters: Parameters) -> InfoByPosition:
    """Raises ServiceException."""
    shared = _parse_info(parameters)
    crs = parameters.require("crs")
    texts = parse_list(parameters.require("coordinate"))
    if len(texts) != 3 or not all(texts):
        raise invalid("coordinate", f"{quote(','.join(texts))}, expected three coordinates")
    x1, x2, x3 = (parse_number(text, "coordinate") for text in texts)
    tolerance = parameters.non_empty("tolerance")
    tolerance_m = None if tolerance is None else parse_number(tolerance, "tolerance")
    if tolerance_m is not None and not 0 <= tolerance_m <= 1000:
        raise invalid("tolerance", f"{tolerance_m:g} m, expected 0 to 1000")
    return InfoByPosition(**vars(shared), crs=crs, position=(x1, x2, x3), tolerance_m=tolerance_m)


def parse_info_by_object_id(parameters: Parameters) -> InfoByObjectId:
    """Raises ServiceException."""
    shared = _parse_info(parameters)
    texts = parse_list(parameters.require("objectId"))
    if len(texts) > MAX_FEATURES:
        raise invalid("objectId", f"{len(texts)} ids, the limit is {MAX_FEATURES}")
    count = shared.feature_count
    if count is not None and count != len(texts):
        raise invalid("featureCount", f"{count}, but objectId has {len(texts)} ids")
    return InfoByObjectId(**vars(shared), object_ids=tuple(_parse_object_id(text) for text in texts))


def _parse_object_id(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= 10 and int(text) <= 0xFFFFFFFF):
        raise invalid("objectId", f"{quote(text)}, expected an object id from 0 to 4294967295")
    return int(text)


def _parse_info(parameters: Parameters) -> InfoRequest:
    layers = _parse_layers(parameters)
    count, id_only = parameters.non_empty("featureCount"), parameters.non_empty("idOnly")
    text = parameters.require("format").lower()
    if text not in INFO_FORMATS:
        raise ServiceException("FormatNotSupported", f"format {quote(text)}; expected {', '.join(INFO_FORMATS)}", text)
    return InfoRequest(
        layers=layers,
        feature_count=None if count is None else _parse_feature_count(count),
        id_only=False if id_only is None else parse_flag(id_only, "idOnly"),
        format=text,
    )


def _parse_feature_count(text: str) -> int:
    """Returns the default for anything but a positive integer, as §11.3.2 demands; at most MAX_FEATURES."""
    positive = text.isascii() and text.isdigit() and len(text) <= 9 and int(text) > 0
    return min(int(text), MAX_FEATURES) if positive else DEFAULT_FEATURES


def _parse_layers(parameters: Parameters) -> tuple[str, ...]:
    """Returns the layers; an empty list leaves the choice to the service."""
    text = parameters.get("layers")
    if text is None:
        raise missing("layers")
    layers = parse_list(text)
    if len(layers) > MAX_LAYERS:
        raise invalid("layers", f"{len(layers)} layers, the limit is {MAX_LAYERS}")
    return tuple(layers)


def _parallel_list(parameters: Parameters, name: str, layers: Sequence[str]) -> tuple[str, ...]:
    """Returns a list with one item per layer; none for a missing or empty parameter."""
    items = parse_list(parameters.get(name) or "")
    if items and len(items) != len(layers):
        raise invalid(name, f"{len(items)} items for {len(layers)} layers; expected one per layer")
    return tuple(items)


def _choose(parameters: Parameters, name: str, allowed: Sequence[str]) -> str:
    value = parameters.non_empty(name)
    if value is None:
        return allowed[0]
    if value.lower() not in allowed:
        raise invalid(name, f"{quote(value)}, expected {', '.join(allowed)}")
    return value.lower()


def _parse_bounding_box(parameters: Parameters, crs: str) -> BoundingBox | None:
    text = parameters.non_empty("boundingBox")
    if text is None:
        return None
    items = parse_list(text)
    if len(items) % 2:
        crs = items.pop() or crs
    if len(items) not in (4, 6):
        raise invalid("boundingBox", f"{len(items)} numbers, expected 4 or 6: the lower, then the upper corner")
    numbers = [parse_number(item, "boundingBox") for item in items]
    half = len(numbers) // 2
    low, high = tuple(numbers[:half]), tuple(numbers[half:])
    if any(a > b for a, b in zip(low, high, strict=True)):
        raise invalid("boundingBox", "a lower coordinate is greater than its upper one")
    return BoundingBox(crs, low, high)


def _parse_sun(parameters: Parameters) -> tuple[float, float] | None:
    """Returns (azimuth, elevation) in degrees of the additional parameter `sun`."""
    text = parameters.non_empty("sun")
    if text is None:
        return None
    items = parse_list(text)
    if len(items) != 2:
        raise invalid("sun", f"{quote(text)}, expected azimuth,elevation in degrees")
    azimuth, elevation = (parse_number(item, "sun") for item in items)
    if not (0 <= azimuth <= 360 and 0 < elevation <= 90):
        raise invalid("sun", f"{quote(text)}, expected an azimuth from 0 to 360 and an elevation over 0 to 90 degrees")
    return azimuth % 360.0, elevation


def _parse_portrayal(parts: PortrayalText) -> Portrayal:
    for name in ("width", "height", "projection", "imagelayers", "formats"):
        if name not in parts or not any(parts[name]):
            raise invalid("portrayals", f"{name.upper()} is missing")
    width, height = (parse_integer(_single(parts, name), "portrayals", 1, MAX_SIDE_PX) for name in ("width", "height"))
    if width * height > MAX_PIXELS:
        raise invalid("portrayals", f"{width} × {height} px, the limit is {MAX_PIXELS} pixels")
    layers = tuple(parse_image_layer(text) for text in parts["imagelayers"])
    if len(parts["formats"]) != len(layers):
        raise invalid("portrayals", f"{len(parts['formats'])} formats for {len(layers)} image layers; expected one per image layer")
    formats = tuple(parse_format(text, layer) for text, layer in zip(parts["formats"], layers, strict=True))
    projection = parse_projection(parts["projection"], "portrayals")
    return Portrayal(width, height, projection, layers, formats, _parse_qualities(parts.get("qualities", []), len(layers)))


def _single(parts: PortrayalText, name: str) -> str:
    if len(parts[name]) != 1:
        raise invalid("portrayals", f"{name.upper()} has {len(parts[name])} values, expected one")
    return parts[name][0]


def _parse_qualities(texts: Sequence[str], count: int) -> tuple[int, ...]:
    if not any(texts):
        return (100,) * count
    if len(texts) != count:
        raise invalid("portrayals", f"{len(texts)} qualities for {count} image layers; expected one per image layer")
    return tuple(parse_integer(text, "portrayals", 0, 100) if text else 100 for text in texts)
