"""What other programs see of an object that was clicked in a map: the 3D Portrayal Service, QGIS, messengers that show a link."""

import io
import json
import re
import urllib.request
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import numpy as np
from PIL import Image

from map3d.catalogue import Workspace
from map3d.geometry.views import axes, parse_view, uvd_from_local
from map3d.tiles.manifest import Manifest
from tests.tile_services.pyramid_pixels import PyramidPixels, difference, over_magenta
from tests.tile_services.qgis_process import qgis

DISTANCE_M = 15.0
NEAR_CENTRE_PX = 4


@dataclass(frozen=True)
class Clicked:
    """The object of a click as the map's panel and URL state it. `position`: world coordinates of the click; `link`: fragment of the map's URL;
    `rows`: names and values of attributes."""

    id: int
    name: str
    position: tuple[float, float, float]
    view: str
    link: str
    rows: tuple[tuple[str, str], ...]


def panel_name(panel: str) -> str:
    """Returns the object's name in the data: below all data where the title is another."""
    found = re.search(r"gml:id\s+(\S.*)", panel)
    return found[1] if found else panel.splitlines()[0]


def clicked(panel: str, url: str) -> Clicked:
    east, north = re.search(r"Position\s+(-?[\d.]+),\s+(-?[\d.]+)", panel).groups()  # type: ignore[union-attr]
    height = re.search(r"Elevation\s+(-?[\d.]+) m", panel)[1]  # type: ignore[index]
    link = url.partition("#")[2]
    lines = panel.partition("All data\n")[2].partition("\nCopy")[0].splitlines()
    details = tuple(zip(lines[::2], lines[1::2], strict=True))
    id, place = int(dict(details)["id"]), (float(east), float(north), float(height))
    rows = tuple(row for row in details if row[0] not in ("Position", "id", "gml:id"))
    found = Clicked(id, panel_name(panel), place, link.split("/")[0], link, rows)
    assert found.rows, panel
    assert f"/id={found.id}" in link
    return found


def fetch(url: str) -> tuple[bytes, str]:
    """Returns the body and its media type, without the cookies of any browser."""
    with urllib.request.urlopen(url, timeout=120) as answer:
        return answer.read(), answer.headers["Content-Type"]


def shown(value: object) -> str:
    """Returns an attribute as the map shows it: whole numbers without a fraction."""
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def check_portrayal(origin: str, scene: str, crs: str, found: Clicked, pictures: Path) -> None:
    """A perspective camera that looks at the clicked point from the side of the map's view sees the same object there, and knows what it is."""
    forward = axes(parse_view(found.view)).forward
    camera = [position - DISTANCE_M * part for position, part in zip(found.position, forward, strict=True)]
    place = ",".join(f"{value:.3f}" for value in (*camera, *found.position))
    portrayal = f"WIDTH=401;HEIGHT=301;PROJECTION=Perspective,{place},0,0,1,60,,,;IMAGELAYERS=%s;FORMATS=%s"

    def view(layer: str, encoding: str) -> np.ndarray:
        query = urlencode({"crs": crs, "layers": scene, "portrayals": portrayal % (layer, encoding)})
        data, media_type = fetch(f"{origin}/3dps?service=3DPS&version=1.0&request=GetView&{query}")
        assert media_type.partition(";")[0] == "image/png", data[:500]
        pictures.with_name(f"{pictures.name}-{layer.lower()}.png").write_bytes(data)
        with Image.open(io.BytesIO(data)) as image:
            return np.asarray(image.convert("RGB"))

    words = view("OBJECTID", "image/png;mode=24bit;encoding=rgb").astype(int)
    ids = words[..., 0] << 16 | words[..., 1] << 8 | words[..., 2]
    row, column = (size // 2 for size in ids.shape)
    near = ids[row - NEAR_CENTRE_PX : row + NEAR_CENTRE_PX + 1, column - NEAR_CENTRE_PX : column + NEAR_CENTRE_PX + 1]
    assert len(np.unique(view("COLOR", "image/png").reshape(-1, 3), axis=0)) > 100
    query = f"service=3DPS&version=1.0&request=GetFeatureInfoByObjectId&layers={scene}&objectId=%d&format=application/json"
    features = {int(number): json.loads(fetch(f"{origin}/3dps?{query % number}")[0])["featureInfo"][0] for number in {found.id, *near[near > 0]}}
    assert (features[found.id]["objectId"], features[found.id]["featureId"]) == (found.id, found.name)
    # The card is that of the outermost object, with the attributes that only its part has.
    own = features.pop(found.id)["featureAttributeLists"] if found.id not in near else features[found.id]["featureAttributeLists"]
    groups = next(feature["featureAttributeLists"] for feature in features.values() if feature["featureAttributeLists"][-1] == own[-1])
    attributes = {name: value for group in groups for name, value in group.items()}
    assert {name: shown(attributes[name]) for name, _ in found.rows} == dict(found.rows), "the map and the service state the same attributes"


def check_qgis(origin: str, workspace: Path, rendering: str, found: Clicked, folder: Path) -> Path:
    """QGIS shows the pixels of the tiles around the clicked point. Returns its picture."""
    home = Workspace(workspace)
    pixels = PyramidPixels(home, Manifest.load(home.manifest_path(rendering).read_bytes()), found.view)
    frame, zmax = pixels.frame, pixels.manifest.zmax
    local = np.array(found.position) - pixels.manifest.origin
    u, v, _ = uvd_from_local(frame.axes, local)
    left, top = (int(value) - size // 2 for value, size in zip(frame.level_pixel_from_uv(zmax, u, v), (200, 150), strict=True))
    pixel_m = frame.pixel_m(zmax)
    west, north = frame.u0_m + left * pixel_m, frame.v0_m - top * pixel_m
    source = f"WMTS:{origin}/wmts/1.0.0/WMTSCapabilities.xml,layer={rendering}:{found.view}"
    seen: dict[str, Any] = qgis(
        folder, provider="gdal", source=source, size=[200, 150], extent=[west, north - 150 * pixel_m, west + 200 * pixel_m, north]
    )
    assert (seen["valid"], seen["problems"]) == (True, [])
    with Image.open(seen["out"]) as image:
        got = np.asarray(image.convert("RGB"))
    expected = over_magenta(pixels.level("color", zmax)[top : top + 150, left : left + 200])
    assert difference(got, expected) < 0.01
    assert (got[75, 100] != (255, 0, 255)).any()
    return Path(seen["out"])


def check_preview(link: str, found: Clicked) -> bytes:
    """The page behind a shared link names a picture of the link's very view. Returns the picture."""
    page = fetch(link)[0].decode()
    head = {name: unescape(value) for name, value in re.findall(r'<meta property="(og:[^"]*)" content="([^"]*)">', page)}
    view, x, y, z, zoom, *_ = found.link.split("/")
    where = ",".join(f"{float(number):g}" if number is zoom else number.removesuffix(".0") for number in (x, y, zoom))
    assert f"/{where},{view.replace('-', ',')},{z.removesuffix('.0')}/" in head["og:image"], (head, found)
    time = next((part for part in found.link.split("/") if part.startswith("t=")), None)
    address, _, shown = head["og:image"].partition("&")
    assert shown == (time or ""), (head, found)
    # The link's time is that of the test, perhaps at night: colours are counted in the default light.
    assert fetch(head["og:image"])[1] == "image/jpeg"
    data, media_type = fetch(address)
    with Image.open(io.BytesIO(data)) as image:
        pixels = np.asarray(image.convert("RGB"))
    assert (media_type, pixels.shape) == ("image/jpeg", (630, 1200, 3))
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 1000
    return data
