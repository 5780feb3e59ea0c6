"""CityGML files of any size, and the memory that reading one takes: one building over and over, with ids of its own and a place of its own."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

MEGABYTES: Final = (50.0, 200.0, 1000.0)
WALLS: Final = 40
SPACING_M: Final = 30
ROW: Final = 500
"""Buildings in a row."""
_HEAD: Final = (
    '<?xml version="1.0" encoding="UTF-8"?>\n<CityModel xmlns="http://www.opengis.net/citygml/2.0" '
    'xmlns:bldg="http://www.opengis.net/citygml/building/2.0" '
    'xmlns:app="http://www.opengis.net/citygml/appearance/2.0" xmlns:gml="http://www.opengis.net/gml">\n'
)
_PROGRAM: Final = """
import json, sys, time
from map3d.ingest.parse_document import open_document_parser
request, started = json.loads(sys.argv[1]), time.process_time()
answer = open_document_parser({})(request, [], lambda counts: None)[0]
peak = next(int(line.split()[1]) * 1024 for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(json.dumps({"peak_bytes": peak, "triangles": answer["report"]["triangles"], "cpu_s": time.process_time() - started}))
"""


@dataclass(frozen=True)
class Reading:
    """The import of one file in a process of its own. `peak_bytes`: its greatest resident memory."""

    bytes: int
    triangles: int
    peak_bytes: int
    cpu_s: float


def write_citygml(path: Path, size: int, textured: bool = True) -> Path:
    """Writes a file of at least `size` bytes, and the image of its walls beside it."""
    with path.open("w", encoding="utf-8") as file:
        written, number = file.write(_HEAD), 0
        while written < size:
            written += file.write(_building(number, textured))
            number += 1
        file.write("</CityModel>\n")
    if textured:
        _write_image(path.with_name("wall.png"))
    return path


def read_in_process(path: Path) -> Reading:
    """Imports a file and returns what that took."""
    with tempfile.TemporaryDirectory(prefix="map3d-large-") as folder:
        reader = {"strict": False, "folder": str(path.parent)}
        request = {
            "path": str(path),
            "format": "citygml",
            "folder": folder,
            "reader": reader,
            "crs": "local",
            "scene_crs": "local",
            "placing": {},
            "place": None,
        }
        done = subprocess.run([sys.executable, "-c", _PROGRAM, json.dumps(request)], check=True, capture_output=True, text=True)
    return Reading(path.stat().st_size, **json.loads(done.stdout))


def measure(megabytes: Sequence[float]) -> list[dict[str, Any]]:
    """Measures files of these sizes and prints a line for each."""
    readings = []
    for size in megabytes:
        with tempfile.TemporaryDirectory(prefix="map3d-large-") as folder:
            reading = read_in_process(write_citygml(Path(folder) / "large.gml", int(size * 1e6)))
        readings.append(asdict(reading))
        rate = reading.bytes / 1e6 / reading.cpu_s
        print(f"{reading.bytes / 1e6:,.0f} MB: {reading.triangles:,} triangles, {reading.peak_bytes / 2**20:,.0f} MiB at most, {rate:,.1f} MB/s")
    return readings


def _building(number: int, textured: bool) -> str:
    x, y = number % ROW * SPACING_M, number // ROW * SPACING_M
    members, targets = [], []
    for wall in range(WALLS):
        name, low, high = f"b{number}-w{wall}", x + wall * 0.25, x + wall * 0.25 + 0.25
        points = f"{low:.3f} {y:.3f} 0.000 {high:.3f} {y:.3f} 0.000 {high:.3f} {y:.3f} 9.125 {low:.3f} {y:.3f} 9.125 {low:.3f} {y:.3f} 0.000"
        members.append(
            f'<gml:surfaceMember><gml:Polygon gml:id="{name}"><gml:exterior><gml:LinearRing gml:id="{name}-r"><gml:posList srsDimension="3">{points}'
            "</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>\n"
        )
        targets.append(
            f'<app:target uri="#{name}"><app:TexCoordList><app:textureCoordinates ring="#{name}-r">'
            "0.125 0.25 0.375 0.25 0.375 0.875 0.125 0.875 0.125 0.25"
            "</app:textureCoordinates></app:TexCoordList></app:target>\n"
        )
    appearance = (
        "<app:appearance><app:Appearance><app:theme>photos</app:theme><app:surfaceDataMember><app:ParameterizedTexture><app:imageURI>wall.png</app:imageURI>"
        f"{''.join(targets)}</app:ParameterizedTexture></app:surfaceDataMember></app:Appearance></app:appearance>"
    )
    return (
        f'<cityObjectMember><bldg:Building gml:id="b{number}">{appearance if textured else ""}'
        f'<bldg:measuredHeight uom="m">9.125</bldg:measuredHeight>'
        f"<bldg:lod2MultiSurface><gml:MultiSurface>{''.join(members)}</gml:MultiSurface></bldg:lod2MultiSurface></bldg:Building></cityObjectMember>\n"
    )


def _write_image(path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (64, 64), (180, 120, 90)).save(path)
