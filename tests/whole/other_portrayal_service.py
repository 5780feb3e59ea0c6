"""A small 3D Portrayal Service of other habits, written from the standard's text (OGC 15-001r4) alone: it shares no code with map3d.

Coloured boxes, ray-traced at pixel centres. Northings come first (EPSG:31468); layers are nested and inherit; the operations have URLs of their own
with a query; the projection's parameters have another order; one image per answer. `/plain` has nothing but COLOR as JPEG; `/full` has all image
layers in the standard's default encodings and feature information. `/faults/<kind>` is `/full` with one fault.
"""

import io
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray
from PIL import Image

VIEWER = Path(__file__).parents[2] / "viewer" / "dist"
EAST, NORTH, BASE = 4468000.0, 5334000.0, 520.0
CRS = "urn:ogc:def:crs:EPSG::31468"
STYLE = "body{margin:0}canvas{width:100vw;height:100vh;display:block}"
PAGE = f"<!doctype html><html lang=en><title>other</title><style>{STYLE}</style><canvas id=map></canvas></html>".encode()


@dataclass(frozen=True)
class Block:
    """A box; corners in metres from (EAST, NORTH, BASE)."""

    id: int
    name: str
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    color: tuple[int, int, int]

    @property
    def roof(self) -> list[float]:
        """The middle of the roof: easting, northing, height."""
        return [EAST + (self.low[0] + self.high[0]) / 2, NORTH + (self.low[1] + self.high[1]) / 2, BASE + self.high[2]]


BLOCKS = (
    Block(7, "ground", (-60, -40, -1), (60, 40, 0), (150, 170, 130)),
    Block(70_000, "hall <i>", (-45, -25, 0), (-15, 5, 12), (200, 60, 50)),
    Block(9_000_001, "tower & gate", (25, 15, 0), (37, 27, 30), (60, 80, 210)),
    Block(16_000_000, "barn", (10, -30, 0), (40, -15, 6), (230, 200, 60)),
)
ORDER = ("NearPlane", "FarPlane", "Roll", "Left", "Right", "Bottom", "Top", "UP", "POI", "POC")
"""Order of the projection's parameters."""


class Refusal(Exception):
    """An exception report: code, locator."""


def capabilities(path: str, full: bool) -> str:
    formats = {"COLOR": ["image/png", "image/jpeg"], "DEPTH": ["image/png;mode=32bit"], "OBJECTID": ["image/png;mode=24bit"], "NORMAL": ["image/png"]}
    offered = formats if full else {"COLOR": ["image/jpeg"]}
    images = "".join(
        f"<v:AvailableImageLayer><Identifier>http://www.opengis.net/spec/3DPS/1.0/concept/service/view/imageLayers/{name.lower()}</Identifier>"
        + "".join(f"<v:AvailableFormat>{one}</v:AvailableFormat>" for one in types)
        + "</v:AvailableImageLayer>"
        for name, types in offered.items()
    )
    parameters = "".join(f'<v:ProjectionParameter name="{name}"{"" if name in ("POC", "POI", "UP") else optional()}/>' for name in ORDER)
    url = f'<DCP><HTTP><Get l:href="http://other.test{path}/ask?city=1&amp;"/></HTTP></DCP>'
    parameter = '<Parameter name="Format"><AllowedValues><Value>text/html</Value><Value>text/xml</Value></AllowedValues></Parameter>'
    info = f'<Operation name="GetFeatureInfoByObjectId">{url}{parameter}</Operation>' if full else ""
    low, high = BLOCKS[0].low, (60.0, 40.0, 30.0)
    return f"""<?xml version="1.0" encoding="ISO-8859-1"?>
<p:Capabilities version="1.0" xmlns="http://www.opengis.net/ows/2.0" xmlns:p="http://www.opengis.net/3dps/1.0/core" xmlns:v="http://www.opengis.net/3dps/1.0/view"
 xmlns:i="http://www.opengis.net/3dps/1.0/info" xmlns:l="http://www.w3.org/1999/xlink">
<ServiceIdentification><Title>Bl\u00f6cke</Title><ServiceType>3DPS</ServiceType><ServiceTypeVersion>1.0</ServiceTypeVersion></ServiceIdentification>
<ServiceProvider><ProviderName>B\u00fcro f\u00fcr Kl\u00f6tze</ProviderName><ServiceContact/></ServiceProvider>
<OperationsMetadata><Operation name="GetCapabilities">{url}</Operation><Operation name="GetView">{url}</Operation>{info}</OperationsMetadata>
<p:Contents><p:Layer><Identifier>all</Identifier><p:AvailableCRS>EPSG:4326</p:AvailableCRS><p:AvailableCRS>{CRS}</p:AvailableCRS>
<p:Layer><Title>Blocks</Title><Identifier>blocks,1</Identifier>
<WGS84BoundingBox><LowerCorner>11.5699 48.1437</LowerCorner><UpperCorner>11.5716 48.1444</UpperCorner></WGS84BoundingBox>
<BoundingBox crs="EPSG:4326" dimensions="3"><LowerCorner>48.1437 11.5699 519</LowerCorner><UpperCorner>48.1444 11.5716 550</UpperCorner></BoundingBox>
<BoundingBox crs="{CRS}" dimensions="3"><LowerCorner>{NORTH + low[1]} {EAST + low[0]} {BASE + low[2]}</LowerCorner>
<UpperCorner>{NORTH + high[1]} {EAST + high[0]} {BASE + high[2]}</UpperCorner></BoundingBox>
<p:Extensions><i:InfoLayerExtension queryable="{"true" if full else "false"}"/></p:Extensions></p:Layer></p:Layer></p:Contents>
<p:PortrayalCapabilities><p:Extensions><v:ViewPortrayalCapabilitiesExtension><v:SupportsMultipleViews>false</v:SupportsMultipleViews>{images}
<v:AvailableProjection><v:TypeName>Perspective</v:TypeName></v:AvailableProjection>
<v:AvailableProjection><v:TypeName>Orthographic</v:TypeName>{parameters}</v:AvailableProjection>
</v:ViewPortrayalCapabilitiesExtension></p:Extensions></p:PortrayalCapabilities></p:Capabilities>"""


def optional() -> str:
    return ' required="false"'


def parse(query: str) -> dict[str, str]:
    """Returns the raw values by upper-case name."""
    return {name.upper(): value for name, _, value in (pair.partition("=") for pair in query.split("&") if pair)}


@dataclass(frozen=True)
class View:
    """`origin`: of each pixel's ray, (h, w, 3), east, north, up."""

    origins: NDArray[np.float64]
    forward: NDArray[np.float64]
    near: float
    far: float
    image_layer: str
    format: str


def parse_view(values: dict[str, str]) -> View:
    for name in ("VERSION", "CRS", "LAYERS", "PORTRAYALS"):
        if not values.get(name):
            raise Refusal("MissingParameterValue", name)
    if unquote(values["CRS"]) != CRS:
        raise Refusal("InvalidParameterValue", "CRS")
    if [unquote(item) for item in values["LAYERS"].split(",")] != ["blocks,1"]:
        raise Refusal("InvalidParameterValue", "LAYERS")
    parts = dict(part.split("=", 1) for part in values["PORTRAYALS"].split(";"))
    if "@" in values["PORTRAYALS"] or "," in parts["IMAGELAYERS"]:
        raise Refusal("OptionNotSupported", "one image, please")
    width, height = int(parts["WIDTH"]), int(parts["HEIGHT"])
    name, *items = (unquote(item) for item in parts["PROJECTION"].split(","))
    numbers: dict[str, list[float | None]] = {}
    for parameter in ORDER:
        count = 3 if parameter in ("UP", "POI", "POC") else 1
        given, items = items[:count], items[count:]
        numbers[parameter] = [float(item) if item else None for item in given]
    if name != "Orthographic" or items:
        raise Refusal("InvalidParameterValue", "PROJECTION")
    poc, poi, up = (np.array([value[1], value[0], value[2]], float) for value in (numbers["POC"], numbers["POI"], numbers["UP"]))
    forward = (poi - poc) / np.linalg.norm(poi - poc)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    upward = np.cross(right, forward)
    left, far_right, bottom, top, near, far = (float(numbers[key][0] or 0.0) for key in ("Left", "Right", "Bottom", "Top", "NearPlane", "FarPlane"))
    x = left + (np.arange(width) + 0.5) / width * (far_right - left)
    y = top - (np.arange(height) + 0.5) / height * (top - bottom)
    origins = poc + x[None, :, None] * right + y[:, None, None] * upward - (EAST, NORTH, BASE)
    return View(origins, forward, near, far, unquote(parts["IMAGELAYERS"]).rsplit("/", 1)[-1].upper(), unquote(parts["FORMATS"]))


def render(view: View) -> dict[str, NDArray[np.float64]]:
    """Returns depth (infinite without a surface), id, color and normal."""
    shape = view.origins.shape[:2]
    found = {"depth": np.full(shape, np.inf), "id": np.zeros(shape), "color": np.full((*shape, 3), 255.0), "normal": np.zeros((*shape, 3))}
    with np.errstate(divide="ignore", invalid="ignore"):
        for block in BLOCKS:
            to_low, to_high = ((np.array(corner) - view.origins) / view.forward for corner in (block.low, block.high))
            enter = np.fmin(to_low, to_high)
            nearest, axis = enter.max(axis=2), enter.argmax(axis=2)
            hit = (nearest < np.fmax(to_low, to_high).min(axis=2)) & (nearest > view.near) & (nearest < np.minimum(view.far, found["depth"]))
            found["depth"][hit], found["id"][hit] = nearest[hit], block.id
            found["color"][hit] = block.color
            found["normal"][hit] = (-np.sign(view.forward) * np.eye(3))[axis[hit]]
    return found


def encode(view: View) -> tuple[str, bytes]:
    """Encodes in the default encodings of Table 35: the least significant byte of words is in R, x of normals in B."""
    arrays = render(view)
    match view.image_layer:
        case "COLOR":
            pixels = arrays["color"].astype(np.uint8)
        case "OBJECTID":
            pixels = arrays["id"].astype("<u4").view(np.uint8).reshape(*arrays["id"].shape, 4)[..., :3]
        case "NORMAL":
            coded = np.rint((arrays["normal"] + 1) / 2 * 255)
            pixels = np.where(arrays["id"][..., None] > 0, coded, 0)[..., ::-1].astype(np.uint8)
        case "DEPTH":
            pixels = arrays["depth"].astype("<f4").view(np.uint8).reshape(*arrays["depth"].shape, 4)
        case other:
            raise Refusal("InvalidParameterValue", other)
    kind = view.format.split(";")[0]
    data = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(data, kind.split("/")[1].upper(), quality=95)
    return kind, data.getvalue()


def feature_info(values: dict[str, str]) -> str:
    block = next((one for one in BLOCKS if str(one.id) == values.get("OBJECTID")), None)
    if block is None:
        raise Refusal("InvalidParameterValue", "objectId")
    attributes = f'<q:FeatureAttribute name="height">{block.high[2]}</q:FeatureAttribute><q:FeatureAttribute name="__proto__">x</q:FeatureAttribute>'
    return (
        '<q:FeatureInfo xmlns:q="http://www.opengis.net/3dps/1.0/info"><q:FeatureInfoList featureType="Block">'
        f"<q:ObjectId>{block.id}</q:ObjectId><q:FeatureId>{escape(block.name)}</q:FeatureId>"
        f"<q:FeatureAttributeList>{attributes}</q:FeatureAttributeList></q:FeatureInfoList></q:FeatureInfo>"
    )


def report(code: str, locator: str) -> str:
    return (
        '<o:ExceptionReport xmlns:o="http://www.opengis.net/ows/2.0" version="1.0.0">'
        f'<o:Exception exceptionCode="{code}" locator="{locator}"><o:ExceptionText>No &lt;thanks&gt;</o:ExceptionText></o:Exception>'
        "</o:ExceptionReport>"
    )


Reply = tuple[int, str, bytes]
XML = "application/xml"


def with_fault(kind: str, operation: str, reply: Reply) -> Reply:
    """Returns the reply with a fault: of the capabilities for kinds that begin with `document-`, else of images."""
    _, media_type, body = reply
    if (operation == "GETVIEW") == kind.startswith("document-") or operation == "GETFEATUREINFOBYOBJECTID":
        return reply
    picture = io.BytesIO()
    Image.new("RGB", (128, 256)).save(picture, "PNG")
    faults: dict[str, Reply] = {
        "exception": (400, XML, report("StyleNotDefined", "styles").encode()),
        "exception-200": (200, "application/vnd.ogc.se_xml", report("NoApplicableCode", "").encode()),
        "blank": (200, media_type, b""),
        "no-content": (204, media_type, b""),
        "html": (200, "text/html", b"<h1>Sign in</h1>"),
        "octets": (200, "application/octet-stream", body),
        "disguised": (200, media_type, b"<h1>Not an image at all</h1>" * 3),
        "cut": (200, media_type, body[: len(body) // 2]),
        "huge": (200, media_type, body + bytes(1 << 21)),
        "size": (200, media_type, picture.getvalue()),
        "missing": (404, "text/plain", b"no"),
        "document-doctype": (200, XML, b'<!DOCTYPE x [<!ENTITY a "aaaa">]><p:Capabilities xmlns:p="x">&a;</p:Capabilities>'),
        "document-malformed": (200, XML, body[: len(body) // 2]),
        "document-other": (200, XML, b"<WMS_Capabilities/>"),
        "document-exception": (400, XML, report("VersionNegotiationFailed", "acceptVersions").encode()),
        "document-huge": (200, XML, body + b" " * (17 << 20)),
        "document-perspective": (200, XML, body.replace(b">Orthographic<", b">Isometric<")),
        "document-feet": (200, XML, body.replace(b"11.5716", b"11.5816")),
        "document-scene": (200, XML, body.replace(b'name="GetView"', b'name="GetScene"')),
        "document-no-cors": reply,
    }
    return faults[kind]


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        path, _, query = self.path.partition("?")
        if path == "/favicon.ico":
            self.send((204, "image/png", b""))
        elif path == "/":
            self.send((200, "text/html", PAGE))
        elif (VIEWER / path[1:]).is_file() and ".." not in path:
            self.send((200, "text/javascript", (VIEWER / path[1:]).read_bytes()))
        else:
            self.send(*self.answer(path, parse(query)))

    def answer(self, path: str, values: dict[str, str]) -> tuple[Reply, bool]:
        """Returns the reply, and whether pages of other origins may read it."""
        base = path.removesuffix("/ask")
        operation = values.get("REQUEST", "").upper()
        fault = base.removeprefix("/faults/") if base.startswith("/faults/") else ""
        try:
            reply: Reply
            if values.get("SERVICE") != "3DPS" or (base != path and values.get("CITY") != "1"):
                raise Refusal("MissingParameterValue", "service")
            if operation == "GETVIEW":
                reply = (200, *encode(parse_view(values)))
            elif operation == "GETFEATUREINFOBYOBJECTID":
                reply = (200, "text/xml; charset=utf-8", feature_info(values).encode())
            else:
                reply = (200, XML, capabilities(base, base != "/plain").encode("latin-1"))
        except Refusal as refusal:
            reply = (400, XML, report(*refusal.args).encode())
        return (with_fault(fault, operation, reply) if fault else reply), fault != "document-no-cors"

    def send(self, reply: Reply, shared: bool = True) -> None:
        status, media_type, body = reply
        self.send_response(status)
        if shared:
            self.send_header("Access-Control-Allow-Origin", "*")
        self.send_header("Content-Type", media_type)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        pass


@contextmanager
def other_service() -> Iterator[str]:
    """Yields host and port."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
