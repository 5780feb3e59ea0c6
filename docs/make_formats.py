"""`python docs/make_formats.py DATA`: writes the table of docs/formats.md: what map3d makes of the data sets in the folders of DATA.

What the files hold is counted here, in their text, not by the readers of map3d: elements of CityGML that are city objects or polygons, faces of OBJ,
pixels of rasters. What is drawn and what is skipped is the answer of `map3d inspect`.
"""

import gzip
import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import rasterio

from map3d.ingest.findings import Finding, findings, sum_findings

TARGET: Final = Path(__file__).with_name("formats.md")
BEGIN: Final = "<!-- written by docs/make_formats.py -->\n"
END: Final = "<!-- end of the table -->\n"
OPTIONS: Final[Mapping[str, Sequence[str]]] = {
    "citygml-lyon-small-houses": ("--crs", "EPSG:3946"),
    "malformed-val3dity": ("--crs", "local"),
    "obj-teapot": ("--up", "y"),
    "obj-spot-textured": ("--up", "y"),
}
"""Options of data sets whose files do not say what a reader must know."""
MAX_REASONS: Final = 12
MAX_TEXT: Final = 240

_FEATURES: Final = (
    "Building|BuildingPart|BuildingInstallation|BuildingFurniture|Window|Door|Room|BuildingRoom|Bridge|BridgePart|Tunnel|TunnelPart|Road|Railway|Track|Square"
    "|TransportationComplex|LandUse|PlantCover|SolitaryVegetationObject|WaterBody|ReliefFeature|TINRelief|RasterRelief|CityFurniture|GenericCityObject"
    "|OtherConstruction"
)
_FEATURE: Final = re.compile(rf"<(?:[\w.-]+:)?({_FEATURES})[\s>]".encode())
_POLYGON: Final = re.compile(rb"<(?:[\w.-]+:)?(?:Polygon|PolygonPatch|Triangle|Rectangle)[\s>]")
_COMMENT: Final = re.compile(rb"<!--.*?-->", re.DOTALL)
_FACE: Final = re.compile(rb"^[ \t]*f[ \t]", re.MULTILINE)
_TABLE_HEAD: Final = """| data set | in the files | objects drawn | triangles | textures named, missing | not drawn, and why |
|---|---|--:|--:|--:|---|
"""


@dataclass
class SourceCounts:
    """What is in the files of a data set. `features`: elements of CityGML by name; `others`: files in further formats by suffix."""

    files: Counter[str] = field(default_factory=Counter)
    features: Counter[str] = field(default_factory=Counter)
    polygons: int = 0
    faces: int = 0
    pixels: int = 0
    others: Counter[str] = field(default_factory=Counter)

    def text(self) -> str:
        """Returns e.g. "2 CityGML files: 2 Building, 13 polygons"."""
        parts = []
        if self.files["CityGML"]:
            features = [f"{count:,} {name}" for name, count in self.features.most_common()]
            parts.append(f"{_count(self.files['CityGML'], 'CityGML file')}: {', '.join([*features, _count(self.polygons, 'polygon')])}")
        if self.files["OBJ"]:
            parts.append(f"{_count(self.files['OBJ'], 'OBJ file')}: {_count(self.faces, 'face')}")
        if self.files["raster"]:
            parts.append(f"{_count(self.files['raster'], 'raster')}: {_count(self.pixels, 'pixel')}")
        if self.others:
            parts.append("others: " + ", ".join(f"{count:,} {suffix}" for suffix, count in self.others.most_common()))
        return "; ".join(parts)


def count_source(folder: Path) -> SourceCounts:
    counts = SourceCounts()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        count_file(counts, path)
    return counts


def count_file(counts: SourceCounts, path: Path) -> None:
    suffix = path.suffix.lower()
    if suffix in (".gml", ".citygml", ".xml", ".gz"):
        _count_citygml(counts, path)
    elif suffix == ".obj":
        counts.files["OBJ"] += 1
        counts.faces += len(_FACE.findall(_text_of(path)))
    elif suffix in (".tif", ".tiff"):
        with rasterio.open(path) as raster:
            counts.files["raster"] += 1
            counts.pixels += raster.width * raster.height
    elif suffix in (".json", ".jsonl", ".gltf", ".glb", ".las", ".laz", ".zip", ".poly", ".ply", ".stl", ".off"):
        counts.others[suffix] += 1


def _count_citygml(counts: SourceCounts, path: Path) -> None:
    data = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else _text_of(path)
    text = _COMMENT.sub(b"", data)
    if b"CityModel" not in text[:20_000]:
        counts.others[f"{path.suffix} without a CityModel"] += 1
        return
    counts.files["CityGML"] += 1
    counts.features.update(match.decode() for match in _FEATURE.findall(text))
    counts.polygons += len(_POLYGON.findall(text))


def _text_of(path: Path) -> bytes:
    """Returns the bytes of a text file in an encoding that has ASCII in it."""
    data = path.read_bytes()
    for mark, encoding in ((b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")):
        if data.startswith(mark):
            return data[2:].decode(encoding, "replace").encode()
    return data


def inspect(folder: Path, options: Sequence[str]) -> dict[str, Any]:
    """Returns what `map3d inspect` says of a folder, or {"error"} if it reads nothing there."""
    command = [str(Path(sys.executable).with_name("map3d")), "inspect", str(folder), "--json", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not done.stdout:
        return {"error": done.stderr.strip().splitlines()[-1].removeprefix("map3d: ")}
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def row(folder: Path) -> str:
    options = OPTIONS.get(folder.name, ())
    found = inspect(folder, options)
    name = f"{folder.name} `{' '.join(options)}`" if options else folder.name
    source = count_source(folder).text()
    if "error" in found:
        return f"| {name} | {source} | – | – | – | {_plain(found['error'], folder)} |\n"
    files = found["files"]
    drawn = sum(kind["drawn"] for file in files for kind in file["kinds"])
    triangles = sum(file["triangles"] for file in files)
    textures = [file["textures"] for file in files if file["textures"]]
    images = f"{sum(one['images'] for one in textures):,}, {sum(one['missing'] for one in textures):,}" if textures else "–"
    return f"| {name} | {source} | {drawn:,} | {triangles:,} | {images} | {'; '.join(_not_drawn(found, folder)) or 'nothing'} |\n"


def _not_drawn(found: Mapping[str, Any], folder: Path) -> Iterator[str]:
    """Yields what is not drawn: skipped elements by reason, objects without geometry, and files by reason."""
    skipped: list[Finding] = []
    without: Counter[str] = Counter()
    for file in found["files"]:
        skipped += [found for found in findings(file) if found.skipped]
        without.update({kind["kind"].replace("_", " "): kind["count"] - kind["drawn"] for kind in file["kinds"] if kind["count"] > kind["drawn"]})
    yield from (str(found.message).removesuffix(".") for found in sum_findings(skipped))
    yield from (f"{count:,} {kind} without geometry" for kind, count in without.most_common())
    others = [(path, reason["text"]) for path, reason in [*found["failed"], *found["ignored"]]]
    reasons = Counter(_plain(reason.removeprefix(f"{path}: "), folder, Path(path).name) for path, reason in others)
    for reason, count in reasons.most_common(MAX_REASONS):
        yield f"{_count(count, 'file')}: {reason}"
    if len(reasons) > MAX_REASONS:
        yield f"{_count(sum(sorted(reasons.values(), reverse=True)[MAX_REASONS:]), 'file')} for further reasons"


def _plain(text: str, folder: Path, name: str = "") -> str:
    """Returns a reason as it fits into a cell: without paths, and without what differs between files of the same fault."""
    line = text.replace(f"{folder}/", "").replace(str(folder), "the folder").partition("; map3d reads")[0]
    line = line.replace(name, "the file") if name else line
    plain = " ".join(line.replace("|", "\\|").replace("<", "&lt;").split())
    return plain if len(plain) <= MAX_TEXT else plain[: MAX_TEXT - 1] + "…"


def _count(count: int, noun: str) -> str:
    return f"{count:,} {noun}" if count == 1 else f"{count:,} {noun}s"


def main(data: Path) -> None:
    rows = [row(folder) for folder in sorted(data.iterdir()) if folder.is_dir()]
    text = TARGET.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    TARGET.write_text(before + BEGIN + "\n" + _TABLE_HEAD + "".join(rows) + "\n" + END + rest.partition(END)[2], encoding="utf-8")
    print(TARGET)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python docs/make_formats.py DATA")
    main(Path(sys.argv[1]))
