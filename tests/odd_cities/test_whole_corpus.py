"""A folder with every oddity at once becomes a map and a report in one go; no file of it is passed over in silence."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from map3d.catalogue import Workspace
from map3d.registry import Registry
from map3d.tiles.decode_tile import decode_tile, layer_with
from map3d.tiles.open_store import open_store
from tests.cli.towns import Run
from tests.odd_cities.corpus import PACKED_MIB, SPARSE_BYTES, SPIRAL_CORNERS, write_corpus
from tests.odd_cities.towns import world_boxes
from tests.publish.test_report_page import Elements

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = [pytest.mark.whole, pytest.mark.endurance]

MIB = 1 << 20
LIMIT_MIB = 320
"""The least that a site of one worker takes."""

SAID = (
    r"sparse\.gml\W*a sparse file of 53,687,091,200 bytes",
    r"gauss-krueger\.gml.*give --crs OGC:CRS84 to read them as degrees",
    r"no-label\.gml.*the file does not name its CRS; name it with --crs",
    r"town\.json.*CityJSON; convert it to CityGML",
    r"points\.las.*a LAS point cloud",
    r"axes of the file are swapped, so it is read as longitude, latitude.*near Munich, Germany",
    r"Textures not found: 1\..*lost\.png",
    r"The file breaks off; what comes before is kept\.\W*(Example: )?cut",
    r"not in UTF-8 as it claims; other bytes are read as Windows-1252.*latin-1",
    r"transparency of the file is read as opacity.*opacity(\.gml)?: 1 of 2 materials would be invisible, and none opaque; --transparency as-is",
    r"several themes of appearances, of which one is used.*themes(\.gml)?: photos",
    r"Appearances of other themes, not used.*themes(\.gml)?: use",
    r"left out 13 triangles of 2 objects, far from the rest",
    r"town\.gml: 1 triangle, up to 5,33\d km away: house-1-2 \(in part\)",
    r"other-zone\.gml: 12 triangles, up to 446 km away: zone-house-0-0",
)
"""What both the terminal and the report say."""

HOUSES = 4 * 12
"""Triangles of a town of four houses."""

DRAWN = {
    "town.gml": 191,
    "swapped.gml": 108,
    "opacity.gml": HOUSES,
    "themes.gml": HOUSES,
    "packed.gml.gz": HOUSES,
    "shop.obj": 12,
    "spiral.obj": SPIRAL_CORNERS - 2,
    "latin-1.gml": 2,
    "two-lods.gml": 2 + 12,
    "other-zone.gml": 12,
}
"""Triangles of files: a box has 12, a polygon two fewer than corners; a polygon of `town.gml` became one triangle."""

MEASURE = """
import json, resource, subprocess, sys
done = subprocess.run(sys.argv[1:], capture_output=True, text=True)
resident = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
read = next(int(line.split()[1]) for line in open("/proc/self/io") if line.startswith("rchar"))
print(json.dumps([done.returncode, done.stdout, done.stderr, resident, read]))
"""
"""Runs a command and counts for it and all processes below it: the largest resident set, and the bytes read. A process of its own, since a large
parent counts as the resident set of its children."""


@dataclass(frozen=True)
class Measured:
    status: int
    out: str
    err: str
    resident_bytes: int
    read_bytes: int


def measured(folder: Path, *arguments: str) -> Measured:
    """Runs the command line in a process of its own."""
    command = [sys.executable, "-c", MEASURE, sys.executable, "-m", "map3d", *arguments]
    return Measured(*json.loads(subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout))


@pytest.fixture(scope="module")
def city(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_corpus(tmp_path_factory.mktemp("odd") / "city")


@pytest.mark.skipif(sys.platform != "linux", reason="counts what Linux counts")
def test_site_ends_with_a_map_and_a_report(tmp_path: Path, run: Run, city: Path) -> None:
    site = measured(tmp_path, "site", str(city), "-o", "map", "--view", "45-45", "--res", "0.5", "--workers", "1", "--max-memory", f"{LIMIT_MIB}M")
    out, err = site.out, site.err
    assert site.status == 3, err  # a map, and files that could not be read
    assert "near Munich, Germany" in out
    for pattern in SAID:
        assert re.search(pattern, out + err), pattern

    page = Elements((tmp_path / "map" / "report.html").read_text())
    text = re.sub(r"\s+", " ", page.text)
    for pattern in SAID:
        assert re.search(pattern, text), pattern
    assert str(city.parent) not in page.text
    for file in (file for file in city.rglob("*") if file.suffix in (".gml", ".gz", ".obj", ".json", ".las")):
        assert file.name in text, f"nothing is said of {file.name}"
    assert "3 rasters of elevation and 4 rasters of imagery" in text
    assert (tmp_path / "map" / "index.html").is_file()
    manifest = json.loads((tmp_path / "map" / "rendering.json").read_text())
    assert manifest["views"][0]["archives"]
    assert run("verify", "--published", "map")[0] == 0

    assert site.resident_bytes < LIMIT_MIB * MIB
    assert LIMIT_MIB < PACKED_MIB + 100, "a reader that holds the packed document in memory exceeds the limit"
    assert site.read_bytes < SPARSE_BYTES // 10, "the sparse file is neither read nor hashed"


def test_what_is_kept_is_whole(tmp_path: Path, run: Run, city: Path) -> None:
    status, out, _ = run("inspect", str(city), "--json")
    assert status == 1
    found = json.loads(out)
    assert {file["source"]: file["triangles"] for file in found["files"]} | DRAWN == {file["source"]: file["triangles"] for file in found["files"]}
    assert sorted(Path(file).name for file, _ in found["failed"]) == ["gauss-krueger.gml", "no-label.gml", "sparse.gml"]
    lods = {file["source"]: [kind["lod"] for kind in file["kinds"]] for file in found["files"]}
    assert lods["two-lods.gml"] == ["2"], "one level of detail is drawn, the finer"
    (cut,) = (file for file in found["files"] if file["source"] == "cut.gml")
    assert 120 <= cut["triangles"] < 192, "the polygons before the cut are kept"


def test_every_object_is_seen_in_its_colour(tmp_path: Path, run: Run, city: Path) -> None:
    status, _, err = run("site", str(city), "-o", "map", "--view", "0-90", "--res", "1", "--color", "png", "--workers", "1")
    assert status == 3, err
    workspace = Workspace(tmp_path / "workspace")
    boxes = world_boxes(workspace, "city")
    low, high = zip(*boxes.values(), strict=True)
    assert max(high)[0] - min(low)[0] < 2_000, "nothing far away makes the map large"
    assert {f"house-{i}-{j}" for i in range(4) for j in range(4)} <= boxes.keys()

    seen = seen_colours(workspace, "city")
    assert seen.keys() == boxes.keys(), "what has triangles is seen from above"
    houses = [f"house-{i}-{j}" for i in range(2) for j in range(2)]
    assert {f"{prefix}-{house}" for prefix in ("faint", "theme", "packed") for house in houses} <= seen.keys()
    for house in houses:
        assert np.allclose(seen[f"theme-{house}"], (200, 30, 30), atol=3), "the photograph, not the blue of the use map"


def seen_colours(workspace: Workspace, name: str) -> dict[str, np.ndarray]:
    """Returns the median colour of each object in the finest tiles of the view from above."""
    ids, colours = map(np.concatenate, zip(*tile_pixels(workspace.store_path(name, "0-90")), strict=True))
    with Registry(workspace.registry_path(name)) as registry:
        names = {item.id: item.name for item in registry.objects()}
    return {names[int(id)]: np.median(colours[ids == id], axis=0) for id in np.unique(ids[ids != 0])}


def tile_pixels(path: Path) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yields the ids, (n,), and colours, (n, 3), of the pixels of each finest tile."""
    with open_store(path, read_only=True) as store:
        shape = store.shape
        layers = {kind: layer for kind in ("id", "color") if (layer := layer_with(shape.layers, kind)) is not None}
        for x, y in store.list_tile_positions(shape.zmax):
            ids, colours = (
                decode_tile(layer, store.get_tile(shape.layer_number(layer.name), shape.zmax, x, y) or b"", shape.tile_px)[kind]
                for kind, layer in layers.items()
            )
            yield ids.ravel(), colours[..., :3].reshape(-1, 3)
