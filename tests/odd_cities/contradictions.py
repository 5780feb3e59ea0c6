"""The mechanism of the table of contradictions: a folder is imported, and what a build would draw of it, and what is said, is compared with a row."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pyproj import Transformer

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import import_files
from map3d.geometry.crs import horizontal_crs, parse_crs
from map3d.geometry.places import find_place
from map3d.ingest.asset import boxes_within, read_objects
from map3d.ingest.content import find_content
from map3d.ingest.findings import findings
from map3d.ingest.import_options import ImportOptions

Size = tuple[float, float, float]
USED_BESIDE = "used-beside"
"""The note of a file that lies beside another one and belongs to it."""


@dataclass(frozen=True)
class Row:
    """`build` writes a folder. What a build draws of it: `objects`, their number; `at`, the longitude and latitude of their middle; `size_m`, their
    extent along x, y and z; `textures`, the number of images; `left_out`, that of triangles far from the rest. `said`: the codes of all findings,
    and of the notes about files that are no documents; `options`: of the import; `failed`: parts of the reasons for which files are refused."""

    name: str
    build: Callable[[Path], Any]
    at: tuple[float, float]
    size_m: Size
    objects: int
    said: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    failed: tuple[str, ...] = ()
    left_out: int = 0
    textures: int = 0


@dataclass(frozen=True)
class Drawn:
    at: tuple[float, float]
    size_m: Size
    objects: int
    said: tuple[str, ...]
    failed: tuple[str, ...]
    left_out: int
    textures: int

    def __str__(self) -> str:
        size = " × ".join(f"{value:,.1f}" for value in self.size_m)
        said = ", ".join([*self.said, *self.failed]) or "nothing"
        left_out = f", {self.left_out} triangles left out" if self.left_out else ""
        textures = f", {self.textures} textures" if self.textures else ""
        return f"{self.objects} objects{textures}, {size} m, {find_place(*self.at)}{left_out} | {said}"


def draw(folder: Path, options: Mapping[str, Any]) -> Drawn:
    """Imports a folder `city` and returns what a build of it draws, without all that is far from the rest."""
    workspace = Workspace(folder / "workspace").create()
    with workspace.open_catalogue() as catalogue:
        catalogue.create_scene(SceneRecord("city"))
        done = import_files(workspace, catalogue, "city", [folder / "city"], ImportOptions(**options))
        scene, assets = catalogue.scene("city"), catalogue.assets("city")
    assert scene.crs is not None
    assert scene.crs.wkt is not None
    folders = [workspace.asset_folder("city", asset.name) for asset in assets]
    extent = find_content(folders, scene.origin or (0.0, 0.0, 0.0), {}).extent
    within = [boxes_within(one, len(read_objects(one)), extent) for one in folders]
    boxes = [box for found, _ in within for box in found if box is not None]
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    to_degrees = Transformer.from_crs(horizontal_crs(parse_crs(scene.crs.wkt)), "EPSG:4326", always_xy=True)
    lon, lat = to_degrees.transform(*((low + high) / 2)[:2])
    notes = {note.code for _, note in done.ignored} - {USED_BESIDE}
    said = sorted({found.reason.code for asset in assets for found in findings(asset.report)} | notes)
    textures = sum(len(list((one / "textures").iterdir())) for one in folders)
    x, y, z = high - low
    failed = tuple(str(reason) for _, reason in done.failed)
    left_out = sum(sum(outside) for _, outside in within)
    return Drawn((lon, lat), (float(x), float(y), float(z)), len(boxes), tuple(said), failed, left_out, textures)


def check(row: Row, folder: Path) -> str:
    """Returns the line of the table. Raises AssertionError for a row that is not so."""
    row.build(folder / "city")
    drawn = draw(folder, row.options)
    line = f"{row.name} | {drawn}"
    assert np.allclose(drawn.at, row.at, rtol=0.0, atol=3e-5), line
    assert np.allclose(drawn.size_m, row.size_m, rtol=0.004, atol=0.05), line
    assert (drawn.objects, drawn.left_out, drawn.textures) == (row.objects, row.left_out, row.textures), line
    assert drawn.said == tuple(sorted(row.said)), line
    assert len(drawn.failed) == len(row.failed), line
    assert all(part in reason for part, reason in zip(row.failed, drawn.failed, strict=True)), line
    return line
