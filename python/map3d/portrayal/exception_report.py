"""Exception reports in the form that a request asks for: XML, a blank image, or the text drawn into an image (OGC 15-001r4 §8.4.3, §10.4.4)."""

import textwrap
from dataclasses import dataclass
from typing import Final
from xml.sax.saxutils import escape, quoteattr

from PIL import Image, ImageDraw, ImageFont

from map3d.portrayal.answers import NO_STORE, Answer, ImagePart, image_answer
from map3d.portrayal.encodings import encode_image
from map3d.portrayal.image_formats import ImageFormat, parse_format, parse_image_layer
from map3d.portrayal.parameters import Parameters
from map3d.portrayal.requests import MAX_PIXELS, MAX_SIDE_PX
from map3d.portrayal.scalars import Color, parse_color, parse_integer
from map3d.portrayal.service_exception import ServiceException, quote

XML: Final = "text/xml"
BLANK: Final = "blank"
IN_IMAGE: Final = "inimage"
VIEW_FORMS: Final = (XML, BLANK, IN_IMAGE)
INFO_FORMS: Final = (XML,)
_SYNONYMS: Final = {
    "application/xml": XML,
    "application/vnd.ogc.se_xml": XML,
    "application/vnd.ogc.se_blank": BLANK,
    "application/vnd.ogc.se_inimage": IN_IMAGE,
}
REPORT_VERSION: Final = "1.0.0"
DEFAULT_SIDE_PX: Final = 512
WHITE: Final = (255, 255, 255)
INK: Final = (160, 20, 20)


def exception_form(parameters: Parameters, allowed: tuple[str, ...]) -> str:
    """Returns the requested form of exceptions. Raises ExceptionNotSupported."""
    text = parameters.non_empty("exceptions")
    if text is None:
        return XML
    form = _SYNONYMS.get(text.lower(), text.lower())
    if form not in allowed:
        raise ServiceException("ExceptionNotSupported", f"exceptions {quote(text)}; expected {', '.join(allowed)}", text)
    return form


def report(error: ServiceException) -> Answer:
    """Returns an ows:ExceptionReport."""
    locator = "" if error.locator is None else f" locator={quoteattr(_printable(error.locator))}"
    text = (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<ows:ExceptionReport xmlns:ows="http://www.opengis.net/ows/2.0" version="{REPORT_VERSION}" xml:lang="en">\n'
        f'  <ows:Exception exceptionCode="{error.code}"{locator}>\n'
        f"    <ows:ExceptionText>{escape(_printable(str(error)))}</ows:ExceptionText>\n"
        "  </ows:Exception>\n"
        "</ows:ExceptionReport>\n"
    )
    return Answer(error.status, XML, text.encode(), _headers(error))


def image_report(error: ServiceException, parameters: Parameters, form: str) -> Answer:
    """Returns images of the requested sizes and formats, blank or with the text; an XML report if the request does not name an image."""
    frames = _frames(parameters)
    if not frames:
        return report(error)
    color = _background(parameters)
    text = f"{error.code}{f' ({_printable(error.locator)})' if error.locator else ''}: {_printable(str(error))}"
    parts = [ImagePart(str(frame.format), _draw(frame, color, text if form == IN_IMAGE else "")) for frame in frames]
    return image_answer(parts, _headers(error))


def draw_text(width_px: int, height_px: int, color: Color, text: str) -> Image.Image:
    """Returns an image of one colour with wrapped text."""
    image = Image.new("RGB", (width_px, height_px), color)
    size = max(9, min(20, width_px // 24))
    lines = textwrap.wrap(text, max(8, int(width_px / (size * 0.56))))
    if lines:
        ImageDraw.Draw(image).multiline_text((size // 2, size // 2), "\n".join(lines), INK, ImageFont.load_default(size))
    return image


@dataclass(frozen=True)
class _Frame:
    width_px: int
    height_px: int
    format: ImageFormat


def _frames(parameters: Parameters) -> list[_Frame]:
    """Returns the requested images as far as they can be understood; sizes that are not allowed become the default size."""
    frames = []
    for portrayal in parameters.portrayals or ():
        width, height = (_side(portrayal.get(name, [])) for name in ("width", "height"))
        if width * height > MAX_PIXELS:
            width = height = DEFAULT_SIDE_PX
        for layer_text, format_text in zip(portrayal.get("imagelayers", []), portrayal.get("formats", []), strict=False):
            try:
                frames.append(_Frame(width, height, parse_format(format_text, parse_image_layer(layer_text))))
            except ServiceException:
                frames.append(_Frame(width, height, ImageFormat("image/png")))
    return frames


def _side(texts: list[str]) -> int:
    try:
        return parse_integer(texts[0], "portrayals", 1, MAX_SIDE_PX)
    except (ServiceException, IndexError):
        return DEFAULT_SIDE_PX


def _background(parameters: Parameters) -> Color:
    try:
        return parse_color(parameters.non_empty("backgroundColor") or "0xFFFFFF", "backgroundColor")
    except ServiceException:
        return WHITE


def _draw(frame: _Frame, color: Color, text: str) -> bytes:
    image = draw_text(frame.width_px, frame.height_px, color, text)
    modes = {"1bit": "1", "32bit": "RGBA"}
    return encode_image(image.convert(modes.get(frame.format.mode, "RGB")), frame.format, 90)


def _headers(error: ServiceException) -> dict[str, str]:
    return NO_STORE | ({} if error.retry_after_s is None else {"Retry-After": str(error.retry_after_s)})


def _printable(text: str) -> str:
    """Replaces characters that XML cannot hold."""
    return "".join(character if character.isprintable() else "�" for character in text)
