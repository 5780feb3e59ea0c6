"""The towns of `python -m bench view`: copies of one district of 300 buildings with terrain and textures, without trees (bench/district.py)."""

import json
import sys
from pathlib import Path

from map3d.catalogue import Workspace
from map3d.scenes.build import build

from .benchmark_scene import run_verb
from .district import DistrictCopier

BUILDINGS = 300
MAX_MEMORY_BYTES = 2 << 30


def prepare_town(folder: Path, millions: float) -> Path:
    """Returns the folder of a built scene of about `millions` million triangles; keeps what earlier runs made in `folder`."""
    workspace = Workspace(folder / "workspace").create()
    pitch_m = _prepare_district(workspace, folder)
    with workspace.open_catalogue() as catalogue:
        district = catalogue.assets("district")
        each = sum(asset.report["triangles"] for asset in district)
        count = max(1, round(millions * 1e6 / each))
        scene = f"town-{count}"
        if scene not in {known.name for known in catalogue.scenes()}:
            run_verb(["create-scene", scene, "-w", str(workspace.root)])
        there = {asset.name for asset in catalogue.assets(scene)}
        copier = DistrictCopier(workspace, "district", scene, pitch_m)
        missing = [number for number in range(count) if any(f"d{number:04d}-{asset.name}" not in there for asset in district)]
        for number in missing:
            print(f"bench: {scene}: district {number + 1} of {count}", file=sys.stderr, flush=True)
            copier.add_copy(catalogue, number)
        if missing or not (workspace.scene_folder(scene) / "scene.json").is_file():
            build(workspace, catalogue, scene, threads=1, max_memory_bytes=MAX_MEMORY_BYTES)
        return workspace.scene_folder(scene)


def _prepare_district(workspace: Workspace, folder: Path) -> float:
    """Imports the district the first time; returns its side in metres."""
    town, where = folder / "district", ["-w", str(workspace.root)]
    if not (town / "town.json").is_file():
        run_verb(["make-town", "-o", str(town), "--buildings", str(BUILDINGS), "--seed", "7", "--no-trees"])
    catalogue = workspace.open_catalogue()
    imported = {scene.name: len(catalogue.assets(scene.name)) for scene in catalogue.scenes()}
    catalogue.close()
    if "district" not in imported:
        run_verb(["create-scene", "district", *where])
    if not imported.get("district"):
        run_verb(["add-files", "district", str(town), *where])
    return float(json.loads((town / "town.json").read_text())["extent_m"])
