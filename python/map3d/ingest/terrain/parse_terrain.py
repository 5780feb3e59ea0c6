"""Entry point of the limited subprocess that imports terrain: classifies the rasters, determines the scene's CRS, writes the asset folder."""

import math
import resource
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from pyproj import CRS

from map3d.errors import CrsError, ImportFailed
from map3d.geometry.crs import is_local, parse_crs
from map3d.ingest.exactness import stretch_findings
from map3d.ingest.findings import finding
from map3d.ingest.ground_grid import GroundGrid
from map3d.ingest.scene_crs import LOCAL, choose_scene_crs, to_scene_crs
from map3d.ingest.terrain.damaged_reads import READ_ERRORS
from map3d.ingest.terrain.placed_rasters import PlacedRasters
from map3d.ingest.terrain.raster_choice import RasterChoice, choose_rasters
from map3d.ingest.terrain.raster_georeference import open_raster
from map3d.ingest.terrain.raster_groups import split_far
from map3d.ingest.terrain.raster_placement import RasterPlacement
from map3d.ingest.terrain.raster_roles import find_roles
from map3d.ingest.terrain.terrain_checkpoints import GDAL_CACHE_MB
from map3d.ingest.terrain.terrain_import import OnTile, import_terrain
from map3d.ingest.terrain.terrain_options import MAX_WORKERS, TerrainOptions
from map3d.ingest.virtual_raster import check_virtual_raster
from map3d.quantities import names_text
from map3d.subprocess import Handler, ReportProgress

WORKER_BYTES: Final = 64 << 20
BYTES_PER_PX: Final = 40
"""Memory for a pixel of a texture while it is cut from a photo of bytes."""

CONVERTED_BYTES_PER_PX: Final = 100
"""The same for a photo of other values."""


def open_terrain_parser(_setup: Mapping[str, Any]) -> Handler:
    def handle(request: dict[str, Any], _blobs: list[bytes], report_progress: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        return _parse(request, report_progress), []

    return handle


def _parse(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """`request`: {"paths", "folder", "name", "crs", "scene_crs", "scene_origin", "reader", "checkpoints": folder or None, "cores",
    "virtual": the virtual rasters that may be read, and the folders in which the rasters that they name must be,
    "grids": the rasters that RasterReliefs name, and their grids, "ground": the GroundGrid below a photo without elevation model, or None}.

    Returns what map3d.ingest.parse_document returns.
    """
    with PlacedRasters(Path(request["folder"]) / "placed", request["grids"], request["crs"]) as placed:
        return _parse_placed(request, placed, report_progress)


def _parse_placed(request: Mapping[str, Any], placed: PlacedRasters, report_progress: ReportProgress) -> dict[str, Any]:
    strict, stated = request["reader"]["strict"], request["crs"]
    rasters, faults = open_rasters([Path(path) for path in request["paths"]], request["virtual"], placed, strict=strict)
    rasters, misplaced = _placeable(rasters, request)
    roles = find_roles(rasters, request["reader"].get("elevation", ()), frozenset(placed.heights))
    by_use = sorted(roles, key=lambda role: (role.gives != "heights", role.rank))
    target = _choose_target(by_use[0].path, stated, request["scene_crs"])
    bounds, near, far = split_far(rasters, target, stated)
    roles = [role for role in roles if role.path in near]
    if far and request["scene_crs"] is None:
        target = _choose_target(next(role.path for role in by_use if role.path in near), stated, None)
        bounds, *_ = split_far(near, target, stated)
    origin = request["scene_origin"]
    choice = choose_rasters(roles, bounds, None if origin is None else origin[2])
    placement = RasterPlacement(stated, request["scene_crs"], origin)
    for raster in near:
        placement.check(raster)

    def on_tile(_stage: str, done: int, total: int) -> bool:
        report_progress({"done": done, "total": total})
        return True

    max_error_m = request["reader"].get("max_error_m", 0.0)
    grid = None if request["ground"] is None else GroundGrid.load(request["ground"])
    options = TerrainOptions(name=request["name"], max_error_m=max_error_m, crs=stated, ranks=choice.ranks, strict=strict, ground_grid=grid)
    options = replace(options, workers=worker_count(request["cores"], _free_bytes(), options.texture_px, choice.orthos))
    checkpoints = request["checkpoints"] and Path(request["checkpoints"])
    terrain = _import(choice, Path(request["folder"]), target, options, on_tile, checkpoints)
    proposed = LOCAL if target is None else to_scene_crs(target)
    placing = {"from": terrain["crs"] and CRS.from_user_input(terrain["crs"]).name, "to": proposed.name, **terrain["projection"]}
    if placement.place is not None:
        placing["place"] = str(placement.place)
        if terrain["crs"] and target is not None:
            at = (placement.place.lon, placement.place.lat)
            terrain["findings"] += stretch_findings(CRS.from_user_input(terrain["crs"]), target, at)
    terrain["findings"] += [*placement.findings, *placed.findings, *choice.findings]
    if far:
        path, away_m = far[0]
        example = f"{path.name} lies {away_m / 1000:,.0f} km from the other rasters; its CRS may be wrong, else import it alone"
        terrain["findings"].append(finding("raster-far-from-others", len(far), example))
    for code, reasons in (("raster-unreadable", faults), ("raster-misplaced", misplaced)):
        if reasons:
            terrain["findings"].append(finding(code, len(reasons), reasons[0]))
    counts = {"elevation": len(choice.dems), "imagery": len(choice.orthos)}
    first = next(iter([*choice.dems, *choice.orthos])).name
    ground = {"ground": grid.digest} if grid is not None and not choice.dems else {}
    return {"report": {**terrain, "rasters": counts, "first_raster": first, "placing": placing, **ground}, "crs": asdict(proposed)}


def _placeable(rasters: Sequence[Path], request: Mapping[str, Any]) -> tuple[list[Path], list[str]]:
    """Returns the rasters that can lie where they would be put, and why the others cannot. Raises CrsError if there is none, or at the first under
    `strict`."""
    good, errors = list[Path](), list[CrsError]()
    for raster in rasters:
        try:
            RasterPlacement(request["crs"], request["scene_crs"], request["scene_origin"]).check(raster)
            good.append(raster)
        except CrsError as error:
            errors.append(error)
    if errors and (request["reader"]["strict"] or not good):
        raise errors[0]
    return good, [str(error) for error in errors]


def _import(
    choice: RasterChoice, folder: Path, target: CRS | None, options: TerrainOptions, on_tile: OnTile, checkpoints: Path | None
) -> dict[str, Any]:
    """Imports the rasters; without the elevation models, if these have no height at all and there are photos."""
    terrain = import_terrain(choice.dems, choice.orthos, folder, target, options, on_tile, checkpoints=checkpoints)
    if terrain["triangles"] or not choice.dems or not choice.orthos:
        return terrain
    empty, choice.dems = choice.dems, []
    flat = import_terrain([], choice.orthos, folder, target, options, on_tile, checkpoints=checkpoints and checkpoints / "flat")
    flat["findings"] += [finding("elevation-without-heights", len(empty), names_text([path.name for path in empty]))]
    flat["findings"] += [item for item in terrain["findings"] if item["code"] == "raster-damaged"]
    return flat


def open_rasters(paths: Sequence[Path], virtual: Mapping[str, str], placed: PlacedRasters, *, strict: bool) -> tuple[list[Path], list[str]]:
    """Returns the paths at which readable rasters are read, and the faults of the others. `virtual`: virtual rasters → where the rasters that they
    name must be.

    Raises ImportFailed if none is readable, or at the first fault under `strict`.
    """
    readable: list[Path] = []
    faults: list[ImportFailed] = []
    for path in paths:
        try:
            if str(path) in virtual:
                check_virtual_raster(path, Path(virtual[str(path)]))
            place = placed.place(path)
            open_raster(place).close()
            readable.append(place)
        except ImportFailed as error:
            faults.append(error)
        except READ_ERRORS as error:
            faults.append(ImportFailed(f"{path}: not a valid raster: {error}"))
    if faults and (strict or not readable):
        raise faults[0]
    return readable, [str(error) for error in faults]


def worker_count(cores: int, free_bytes: float, texture_px: int, orthos: Sequence[Path]) -> int:
    """Returns the number of threads that may build tiles at once: one per core, as far as the memory suffices."""
    is_bytes = all(_has_bytes(path) for path in orthos)
    each = WORKER_BYTES + texture_px**2 * (BYTES_PER_PX if is_bytes else CONVERTED_BYTES_PER_PX)
    return max(1, min(cores, MAX_WORKERS, int(min(free_bytes / each, MAX_WORKERS))))


def _has_bytes(path: Path) -> bool:
    with open_raster(path) as raster:
        return bool(raster.dtypes[0] == "uint8")


def _free_bytes() -> float:
    """Returns how much of the address space that this process may have is free."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return math.inf
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() if Path("/proc/self/statm").exists() else 0
    return float(limit - used - (GDAL_CACHE_MB << 20))


def _choose_target(raster: Path | None, stated_crs: str | None, scene_crs: str | None) -> CRS | None:
    """Returns the scene's CRS. If it has none yet: the raster's own if projected in metres, else its UTM zone; None if the raster has no CRS.

    `stated_crs`: the user's choice for the raster. Raises CrsError if it is incompatible with a scene in local metres.
    """
    stated = None if stated_crs is None or is_local(stated_crs) else parse_crs(stated_crs)
    if scene_crs is not None:
        if stated is not None and is_local(scene_crs):
            raise CrsError(f"--crs {stated_crs}: the scene is in local metres; add the raster to another scene, or leave the option out")
        return None if is_local(scene_crs) else CRS.from_user_input(scene_crs)
    assert raster is not None, "a source has a path"
    with open_raster(raster) as data:
        if stated is None and (data.crs is None or stated_crs is not None):
            return None
        own = parse_crs(data.crs.to_wkt()) if stated is None else stated
        left, bottom, right, top = data.bounds
    corners = np.array([(left, bottom, 0.0), (right, top, 0.0)])
    north_first = own.is_geographic and own.axis_info[0].direction == "north"
    return choose_scene_crs(own, corners[:, [1, 0, 2]] if north_first else corners)
