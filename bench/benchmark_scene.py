"""The town for the benchmarks, generated once per checkout."""

import shutil
from pathlib import Path

import numpy as np

from map3d import _core
from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.errors import UnknownVersion
from map3d.tiles.naming import block_levels
from map3d.tiles.occupancy import xy_from_morton

from .peers import FrameFields

CACHE = Path(".cache/bench")
Block = tuple[int, int, int]


def prepare_scene(buildings: int, res_m: float, color: str) -> tuple[Path, dict[str, FrameFields]]:
    """Returns the scene's folder and the frame fields of each view. `color`: format of the colour layer."""
    folder = CACHE / f"town-{buildings}"
    workspace = _open_or_recreate(folder / "workspace")
    where = ["-w", str(workspace.root)]
    name = f"{color}-{round(res_m * 1000)}mm"
    catalogue = workspace.open_catalogue()
    scenes = {scene.name for scene in catalogue.scenes()}
    renderings = {rendering.name for rendering in catalogue.renderings()}
    catalogue.close()
    if "town" not in scenes:
        run_verb(["make-town", "-o", str(folder / "town"), "--buildings", str(buildings), "--seed", "7", "--no-trees"])
        run_verb(["create-scene", "town", *where])
        run_verb(["add-files", "town", str(folder / "town"), *where])
    if name not in renderings:
        run_verb(["create-rendering", "town", name, "--res", str(res_m), "--view", "0/45", "--color", color, *where])
    with workspace.open_catalogue() as catalogue:
        record = catalogue.rendering(name)
        return workspace.root / "scenes" / "town", {track.id: track.frame.to_json(track.layers) for track in record.tracks}


def fullest_blocks(scene: _core.Scene, frame: _core.Frame) -> list[tuple[Block, int]]:
    """Returns the base blocks as (z, x, y), each with its number of occupied base tiles, those with the most first."""
    root = block_levels(frame.zmax)[0].root
    numbers, counts = np.unique(scene.occupied(frame, frame.zmax) >> np.uint64(2 * (frame.zmax - root)), return_counts=True)
    columns, rows = xy_from_morton(numbers)
    return [((root, int(columns[k]), int(rows[k])), int(counts[k])) for k in np.lexsort((columns, rows, -counts))]


def _open_or_recreate(folder: Path) -> Workspace:
    """Opens the workspace; recreates one of an older version."""
    try:
        workspace = Workspace(folder).create()
        workspace.open_catalogue().close()
    except UnknownVersion:
        shutil.rmtree(folder)
        workspace = Workspace(folder).create()
    return workspace


def run_verb(command: list[str]) -> None:
    if run(command) != 0:
        raise SystemExit(f"bench: map3d {' '.join(command)} failed")
