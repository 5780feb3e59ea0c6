"""The town that everything is measured on, made once per checkout."""

import shutil
from pathlib import Path
from typing import Any

from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.errors import UnknownVersion

CACHE = Path(".cache/bench")
Fields = dict[str, Any]
"""Fields of a frame: `map3d.geometry.frames.core_frame` makes a `_core.Frame` of them."""


def prepared(buildings: int, res_m: float, color: str) -> tuple[Path, dict[str, Fields]]:
    """The scene's folder, and the fields of the core's frame of each view. `color`: format of the colour layer."""
    folder = CACHE / f"town-{buildings}"
    workspace = _current(folder / "workspace")
    where = ["-w", str(workspace.root)]
    name = f"{color}-{round(res_m * 1000)}mm"
    catalogue = workspace.open_catalogue()
    scenes = {scene.name for scene in catalogue.scenes()}
    renderings = {rendering.name for rendering in catalogue.renderings()}
    catalogue.close()
    if "town" not in scenes:
        _do(["make-town", "-o", str(folder / "town"), "--buildings", str(buildings), "--seed", "7", "--no-trees"])
        _do(["create-scene", "town", *where])
        _do(["add-files", "town", str(folder / "town"), *where])
    if name not in renderings:
        _do(["create-rendering", "town", name, "--res", str(res_m), "--view", "0/45", "--color", color, *where])
    catalogue = workspace.open_catalogue()
    try:
        record = catalogue.rendering(name)
        return workspace.root / "scenes" / "town", {track.id: track.frame.to_json(track.layers) for track in record.tracks}
    finally:
        catalogue.close()


def _current(folder: Path) -> Workspace:
    """The workspace, made anew when it is there from an earlier version."""
    try:
        workspace = Workspace(folder).create()
        workspace.open_catalogue().close()
    except UnknownVersion:
        shutil.rmtree(folder)
        workspace = Workspace(folder).create()
    return workspace


def _do(command: list[str]) -> None:
    if run(command) != 0:
        raise SystemExit(f"bench: map3d {' '.join(command)} failed")
