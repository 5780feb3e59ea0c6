"""A long street of small houses, one in each base block: many jobs that the real renderer does in milliseconds.

Its variants differ in the heights of the houses. All have the same objects, so a workspace can go from one variant to another.
"""

import hashlib
import random
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from map3d.catalogue import Catalogue, SceneRecord, Workspace
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import import_file
from map3d.ingest.sources import find_sources
from map3d.jobs.run import Run
from map3d.jobs.run_settings import RunSettings
from map3d.lifecycle.create_rendering import create_rendering
from map3d.requests import CreateRendering
from map3d.scenes.build import BUILD_BYTES, build
from map3d.tiles.track_stores import open_track
from map3d.types import ViewAngles

SCENE: Final = "street"
RENDERING: Final = "street"
VARIANTS: Final = 4
RES_M: Final = 0.25
SPACING_M: Final = 560.0
"""A base block has a side of 8 · 256 · 0.25 = 512 m."""
VIEWS: Final = (ViewAngles(0, 45), ViewAngles(90, 30))
_BOX: Final = ((0, 0), (1, 0), (1, 1), (0, 1))
_FACES: Final = ("1 2 6 5", "2 3 7 6", "3 4 8 7", "4 1 5 8", "5 6 7 8", "4 3 2 1")


@dataclass(frozen=True)
class Expected:
    """The undisturbed result of one variant. `tiles`: digests of all its tiles."""

    digest: str
    tiles: frozenset[str]


def street_file(folder: Path, variant: int, houses: int) -> Path:
    """Writes the OBJ file of a variant and returns its path; all variants have the same file name."""
    choose = random.Random(houses)
    lines = []
    for house in range(houses):
        x, y = house * SPACING_M, choose.uniform(-40, 40)
        width, height = choose.uniform(8, 30), choose.uniform(5, 20)
        if variant and (house + variant) % 3 == 0:
            height += 4.0 * variant
        lines.append(f"o house{house:04}")
        lines += [f"v {x + a * width:.3f} {y + b * width:.3f} {c * height:.3f}" for c in (0, 1) for a, b in _BOX]
        lines += ["f " + " ".join(str(8 * house + int(corner)) for corner in face.split()) for face in _FACES]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "street.obj"
    path.write_text("\n".join(lines) + "\n")
    return path


def import_variant(workspace: Workspace, catalogue: Catalogue, path: Path) -> None:
    import_file(workspace, catalogue, SCENE, find_sources([path])[0], ImportOptions(split="group"))


def change_variant(workspace: Workspace, variant: int, houses: int) -> None:
    """Imports and builds another variant; the frames of the rendering stay."""
    catalogue = workspace.open_catalogue()
    try:
        import_variant(workspace, catalogue, street_file(workspace.root / "files", variant, houses))
        build(workspace, catalogue, SCENE, threads=1, max_memory_bytes=BUILD_BYTES)
    finally:
        catalogue.close()


def make_workspace(root: Path, houses: int, variant: int = 0, catalogue_url: str | None = None) -> Workspace:
    """Creates a workspace with the imported, built street and an unrendered rendering of it."""
    workspace = Workspace(root, catalogue_url).create()
    catalogue = workspace.open_catalogue()
    try:
        catalogue.create_scene(SceneRecord(SCENE))
        import_variant(workspace, catalogue, street_file(root / "files", variant, houses))
        build(workspace, catalogue, SCENE, threads=1, max_memory_bytes=BUILD_BYTES)
        layers = ("color", "id")
        request = CreateRendering(scene=SCENE, name=RENDERING, views=tuple(VIEWS), res_m=RES_M, layers=layers, color="png")
        create_rendering(workspace, catalogue, request)
    finally:
        catalogue.close()
    return workspace


def render_undisturbed(workspace: Workspace, workers: int = 2) -> Expected:
    catalogue = workspace.open_catalogue()
    try:
        run = Run(workspace, catalogue, RENDERING, RunSettings(workers))
        result = run.work(run.plan(), lambda _event: None)
        assert result.complete, result
    finally:
        catalogue.close()
    return read_result(workspace)


def read_result(workspace: Workspace) -> Expected:
    """Returns the digest of every tile and seam in the stores, which does not depend on how often blocks were rendered."""
    total, tiles = hashlib.sha256(), set()
    catalogue = workspace.open_catalogue()
    try:
        record = catalogue.rendering(RENDERING)
        for track in record.tracks:
            with open_track(workspace, record, track.id) as store:
                for block in store.list_blocks():
                    if block.tiles:
                        total.update(f"{block.id} {block.key} {block.tiles} ".encode() + (store.get_seam(block.id) or b"-"))
                for layer in range(len(track.layers)):
                    for tile in store.list_tiles(layer):
                        data = store.get_tile(layer, *tile)
                        assert data is not None
                        total.update(f"{layer} {tile} ".encode() + data)
                        tiles.add(hashlib.sha256(data).hexdigest())
    finally:
        catalogue.close()
    return Expected(total.hexdigest(), frozenset(tiles))
