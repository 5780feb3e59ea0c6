"""Image layers and their formats: parameterised MIME types (OGC 15-001r4 Tables 35 and 36)."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from map3d.portrayal.service_exception import invalid, quote

ImageType = str
"""png, jpeg or webp."""

CONCEPT: Final = "http://www.opengis.net/spec/3DPS/1.0/concept/service/view/imageLayers/"
_SYNTAX: Final = re.compile(r"(image/[a-z]+)((?:;[a-z]+=[a-z0-9-]+)*)", re.ASCII)
_SYNONYMS: Final = {"image/jpg": "image/jpeg"}


@dataclass(frozen=True)
class ImageFormat:
    """`mode`: 1bit, 24bit or 32bit, empty where the server chooses; `encoding`: empty for the default one of the standard."""

    media_type: str
    mode: str = ""
    encoding: str = ""

    @property
    def image_type(self) -> ImageType:
        return self.media_type.partition("/")[2]

    @property
    def lossy(self) -> bool:
        """Whether the quality of a portrayal applies."""
        return self.image_type != "png"

    def __str__(self) -> str:
        parameters = [f"{name}={value}" for name, value in (("mode", self.mode), ("encoding", self.encoding)) if value]
        return ";".join([self.media_type, *parameters])


@dataclass(frozen=True)
class ImageLayer:
    """`kinds`: the layers of a G-buffer that it is made from; `uri`: of the standard's concept, None for an additional image layer."""

    name: str
    title: str
    abstract: str
    uri: str | None
    kinds: tuple[str, ...]
    formats: tuple[ImageFormat, ...]


def _formats(*texts: str) -> tuple[ImageFormat, ...]:
    return tuple(_parse(text) for text in texts)


def _parse(text: str) -> ImageFormat:
    """Raises ValueError unless the text is a MIME type with parameters that this service knows."""
    match = _SYNTAX.fullmatch(re.sub(r"[\s+]*;[\s+]*", ";", text.strip().lower()))
    if match is None:
        raise ValueError(text)
    parameters = dict(part.split("=") for part in match[2].split(";") if part)
    if set(parameters) - {"mode", "encoding"} or len(parameters) != match[2].count(";"):
        raise ValueError(text)
    media_type = _SYNONYMS.get(match[1], match[1])
    return ImageFormat(media_type, parameters.get("mode", ""), parameters.get("encoding", ""))


_DATA: Final = ("image/png", "image/png;mode=24bit", "image/png;mode=32bit")
_GRAY: Final = ("image/png", "image/jpeg")

IMAGE_LAYERS: Final[Mapping[str, ImageLayer]] = {
    layer.name: layer
    for layer in (
        ImageLayer(
            "COLOR", "Colour", "The surfaces' colours, without light", CONCEPT + "color", ("color",), _formats(*_DATA, "image/jpeg", "image/webp")
        ),
        ImageLayer(
            "DEPTH",
            "Depth",
            "Distance from the plane of the POC to the visible surface along the viewing direction, metres; infinite without a surface",
            CONCEPT + "depth",
            ("depth",),
            _formats(*_DATA, "image/png;mode=24bit;encoding=rgb", "image/png;mode=32bit;encoding=rgba", "image/png;mode=24bit;encoding=millimetres"),
        ),
        ImageLayer(
            "OBJECTID",
            "Object ids",
            "Id of the visible object, 0 without one",
            CONCEPT + "objectid",
            ("id",),
            _formats(*_DATA, "image/png;mode=24bit;encoding=rgb", "image/png;mode=32bit;encoding=rgba"),
        ),
        ImageLayer(
            "NORMAL",
            "Normals",
            "Unit normal of the visible side: x east, y north, z up",
            CONCEPT + "normal",
            ("normal",),
            _formats(*_DATA, "image/png;mode=24bit;encoding=rgb", "image/jpeg"),
        ),
        ImageLayer(
            "MASK",
            "Mask",
            "Black where an object is visible, else white",
            CONCEPT + "mask",
            ("id",),
            _formats("image/png", "image/png;mode=1bit", "image/jpeg"),
        ),
        ImageLayer(
            "AO", "Ambient occlusion", "How open the surroundings of the surface are: 0 closed, 255 open or nothing", None, ("ao",), _formats(*_GRAY)
        ),
        ImageLayer("SUN", "Sunlight", "Share of direct sunlight: 0 shadow, 255 lit or nothing", None, ("sun",), _formats(*_GRAY)),
    )
}


def parse_image_layer(text: str) -> ImageLayer:
    """Accepts names in any case, and the URIs of the standard's image layers. Raises InvalidParameterValue."""
    for layer in IMAGE_LAYERS.values():
        if text.upper() == layer.name or text == layer.uri:
            return layer
    raise invalid("portrayals", f"no image layer {quote(text)}; expected {', '.join(IMAGE_LAYERS)}")


def parse_format(text: str, layer: ImageLayer) -> ImageFormat:
    """Returns an advertised format of the layer. Raises InvalidParameterValue."""
    try:
        found = _parse(text)
    except ValueError:
        found = None
    if found not in layer.formats:
        raise invalid("portrayals", f"{layer.name} has no format {quote(text)}; expected {', '.join(map(str, layer.formats))}")
    assert found is not None, "None is not among the formats"
    return found
