"""What the limited child of a terrain import does: tells elevation from imagery, settles the system, has the asset written."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from pyproj import CRS

from map3d.errors import ImportFailed
from map3d.ingest.crs import LOCAL, is_local, parse_crs, scene_crs
from map3d.ingest.crs_transformer import choose_target
from map3d.ingest.terrain.raster_georeference import open_raster
from map3d.ingest.terrain.terrain_import import TerrainOptions, import_terrain
from map3d.subprocess import Handler, ReportProgress

IMAGE_BANDS: Final = (3, 4)


def open_terrain(_setup: Mapping[str, Any]) -> Handler:
    def work(question: dict[str, Any], _blobs: list[bytes], report_progress: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        return _import(question, report_progress), []

    return work


def _import(question: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """`question`: {"paths", "folder", "name", "crs", "scene_crs"}; see map3d.ingest.parse_document for the answer."""
    rasters, damaged = usable([Path(path) for path in question["paths"]], strict=question["reader"]["strict"])
    dem, ortho = tell_apart(rasters)
    target = _target(dem or ortho, question["scene_crs"])

    def progress(_stage: str, done: int, total: int) -> bool:
        report_progress({"done": done, "total": total})
        return True

    report = import_terrain(dem, ortho, Path(question["folder"]), target, TerrainOptions(name=question["name"]), progress)
    proposed = LOCAL if target is None else scene_crs(target)
    placing = {"from": report["crs"] and CRS.from_user_input(report["crs"]).name, "to": proposed.name, **report["projection"]}
    if damaged:
        report["warnings"].append({"reason": "raster left out", "count": len(damaged), "example": damaged[0]})
    return {"report": {**report, "placing": placing}, "crs": asdict(proposed)}


def usable(paths: Sequence[Path], *, strict: bool) -> tuple[list[Path], list[str]]:
    """The rasters that can be opened, and why the others cannot. Raises ImportFailed when there is none, or the first fault under `strict`."""
    good: list[Path] = []
    faults: list[ImportFailed] = []
    for path in paths:
        try:
            open_raster(path).close()
            good.append(path)
        except ImportFailed as error:
            faults.append(error)
    if faults and (strict or not good):
        raise faults[0]
    return good, [str(error) for error in faults]


def tell_apart(paths: Sequence[Path]) -> tuple[Path | None, Path | None]:
    """(elevation model, imagery): imagery has three or four bands of bytes, elevation one band. Raises ImportFailed when there are two of a kind."""
    found: dict[str, Path] = {}
    for path in paths:
        with open_raster(path) as raster:
            kind = "imagery" if raster.count in IMAGE_BANDS or raster.dtypes[0] == "uint8" else "elevation"
        if kind in found:
            raise ImportFailed(f"{path}: a second raster of {kind} beside {found[kind].name}; add one elevation model and one image at a time")
        found[kind] = path
    return found.get("elevation"), found.get("imagery")


def _target(raster: Path | None, scene: str | None) -> CRS | None:
    """The scene's system; if it has none yet, the raster's own where that is projected in metres, else the UTM zone of its place."""
    if scene is not None:
        return None if is_local(scene) else CRS.from_user_input(scene)
    assert raster is not None, "a source has a path"
    with open_raster(raster) as data:
        if data.crs is None:
            return None
        own = parse_crs(data.crs.to_wkt())
        left, bottom, right, top = data.bounds
    corners = np.array([(left, bottom, 0.0), (right, top, 0.0)])
    north_first = own.is_geographic and own.axis_info[0].direction == "north"
    return choose_target(own, corners[:, [1, 0, 2]] if north_first else corners)
