"""Imports an elevation model and an orthophoto as an asset of textured terrain tiles (spec/scene.md, Asset).

Without an elevation model the terrain is flat, without a photo it has the colours of its heights. Rasters are read in windows, never as a whole.
"""

import json
import os
import shutil
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import rasterio
from numpy.typing import NDArray
from pyproj import CRS

from map3d.errors import BadRequest, LimitExceeded, Stopped
from map3d.ingest.findings import finding
from map3d.ingest.terrain import terrain_rasters
from map3d.ingest.terrain.height_tint import HeightTint, write_tint
from map3d.ingest.terrain.orthophoto import TextureTile
from map3d.ingest.terrain.terrain_checkpoints import GDAL_CACHE_MB, TerrainCheckpoint, build_checkpoints, texture_folder
from map3d.ingest.terrain.terrain_options import TerrainOptions
from map3d.ingest.terrain.terrain_rasters import REDUCE_RASTER, TerrainRasters
from map3d.ingest.terrain.terrain_tiles import TerrainTile, TileBuilder, TileCounts
from map3d.quantities import names_text

OnTile = Callable[[str, int, int], bool]
"""(stage, done, total) → False to stop."""

CLASS: Final = "terrain"
RANK: Final = 0


class MeshWriter(Protocol):
    """The methods of `map3d._core.AssetWriter` that the terrain import calls."""

    def append_mesh(
        self, positions: NDArray[np.float64], triangles: NDArray[np.uint32], uvs: NDArray[np.float32] | None, material: int, object: int, rank: int
    ) -> None: ...
    def set_tables(self, materials: str, objects: str) -> None: ...
    def finish(self, reader: None) -> str: ...


def import_terrain(
    dem: Path | Sequence[Path] | None,
    ortho: Path | Sequence[Path] | None,
    asset_folder: Path,
    scene_crs: CRS | None,
    options: TerrainOptions | None = None,
    progress: OnTile | None = None,
    writer: MeshWriter | None = None,
    checkpoints: Path | None = None,
) -> dict[str, Any]:
    """Writes the asset into `asset_folder` and returns its report. Several rasters of one kind are a mosaic.

    With `scene_crs` None the scene is local and coordinates stay unchanged. `checkpoints`: their folder, on the same file
    system; only an import of the same rasters into the same scene with the same options may use it again. By default, a part of the asset folder that
    is removed at the end.

    Raises NotFound, ImportFailed, CrsError, LimitExceeded, BadRequest, Stopped.
    """
    options = options or TerrainOptions()
    dems, orthos = _paths(dem), _paths(ortho)
    if not dems and not orthos:
        raise BadRequest("nothing to import; give an elevation model, an orthophoto, or both")
    (asset_folder / "textures").mkdir(parents=True, exist_ok=True)
    folder = checkpoints or asset_folder / "checkpoints"
    try:
        with rasterio.Env(GDAL_CACHEMAX=GDAL_CACHE_MB), TerrainRasters(dems, orthos, scene_crs, options) as rasters:
            if writer is None:
                from map3d._core import AssetWriter

                writer = AssetWriter(str(asset_folder))
            content = _TerrainContent(options.name)
            _write(rasters, options, content, writer, asset_folder / "textures", folder, progress or (lambda *_: True))
            report = _report(rasters, json.loads(writer.finish(None)), content)
    finally:
        if checkpoints is None:
            shutil.rmtree(folder, ignore_errors=True)
    _write_report(asset_folder / "report.json", report)
    return report


def _paths(rasters: Path | Sequence[Path] | None) -> Sequence[Path]:
    return [] if rasters is None else [rasters] if isinstance(rasters, Path) else rasters


@dataclass
class _TerrainContent:
    """Materials and objects of the asset, and counts for its report. `shared`: texture key → index of the material of all tiles with it; None stands
    for the tiles outside the photo, or all without a photo. `tint`: colours of heights, without a photo."""

    name: str
    materials: list[dict[str, Any]] = field(default_factory=list)
    objects: list[dict[str, Any]] = field(default_factory=list)
    triangles: int = 0
    counts: TileCounts = field(default_factory=TileCounts)
    shared: dict[str | None, int] = field(default_factory=dict)
    tint: HeightTint | None = None


def _write(
    rasters: TerrainRasters, options: TerrainOptions, content: _TerrainContent, writer: MeshWriter, textures: Path, folder: Path, progress: OnTile
) -> None:
    grid = rasters.create_grid()
    if rasters.photo is None:
        content.tint = write_tint(textures, grid, rasters.height_field, rasters.covered_tiles(grid))
    done, total = 0, sum(1 for _ in rasters.covered_tiles(grid))
    tiles, workers = rasters.covered_tiles(grid), options.workers
    with closing(build_checkpoints(tiles, total, folder, workers, lambda: TileBuilder(rasters.reopen(), grid, content.tint, options))) as built:
        for checkpoint, count in built:
            if not progress("terrain", done, total):
                raise Stopped(f"terrain import stopped after {done} of {total} tiles; import the file again to resume")
            _append(rasters, checkpoint, content, writer, textures, options)
            done += count
    progress("terrain", total, total)
    writer.set_tables(json.dumps({"materials": content.materials, "instances": []}), json.dumps(content.objects))


def _append(
    rasters: TerrainRasters, checkpoint: TerrainCheckpoint, content: _TerrainContent, writer: MeshWriter, textures: Path, options: TerrainOptions
) -> None:
    content.counts.add(checkpoint.counts)
    for name, _ in checkpoint.textures():
        _link(texture_folder(checkpoint.path.parent) / name, textures / name)
    for tile in checkpoint.read_tiles():
        content.triangles += len(tile.triangles)
        if content.triangles > terrain_rasters.MAX_TRIANGLES:
            limit = terrain_rasters.MAX_TRIANGLES
            raise LimitExceeded(f"{rasters.base.name}: more than {limit:,} triangles, the limit of an asset; {REDUCE_RASTER}")
        uvs = None if tile.uvs is None else tile.uvs[tile.triangles]
        writer.append_mesh(tile.positions, tile.triangles, uvs, _add_material(content, tile, options), len(content.objects), RANK)
        name = _tile_name(content, tile)
        content.objects.append({"name": name, "class": CLASS, "parent": None, "lod": None, "attributes": {}})


def _add_material(content: _TerrainContent, tile: TerrainTile, options: TerrainOptions) -> int:
    """Returns the index of the tile's material. Tiles with the same image share one."""
    key = None if tile.texture is None else tile.texture.key
    if key not in content.shared:
        content.shared[key] = len(content.materials)
        content.materials.append(_material(content, tile.texture, _tile_name(content, tile), options))
    return content.shared[key]


def _material(content: _TerrainContent, texture: TextureTile | None, name: str, options: TerrainOptions) -> dict[str, Any]:
    row: dict[str, Any] = {
        "name": name if texture else "ground",
        "diffuse": [1.0, 1.0, 1.0, 1.0],
        "texture": None,
        "alpha": None,
        "wrap": "clamp",
        "border": [0.0, 0.0, 0.0, 0.0],
        "cutout": False,
    }
    if texture is not None:
        row |= {"texture": texture.key, "cutout": texture.cutout}
    elif content.tint is None:
        row["diffuse"] = [*(value / 255 for value in options.ground), 1.0]
    else:
        row["texture"] = content.tint.key
    return row


def _tile_name(content: _TerrainContent, tile: TerrainTile) -> str:
    return f"{content.name}-{tile.row}-{tile.column}"


def _link(source: Path, target: Path) -> None:
    """Puts a file of a checkpoint into the asset: as a link, so that the checkpoint stays complete, or as a copy if the file system has no links."""
    if target.exists():
        return
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def _report(rasters: TerrainRasters, counts: dict[str, Any], content: _TerrainContent) -> dict[str, Any]:
    """Adds what was found about the rasters to the report of the core."""
    found, name = content.counts, Path(rasters.base.name).name
    by_code = {"grid-points-without-height": found.gaps, "heights-implausible": found.implausible, "tiles-outside-photo": found.untextured}
    counted = [finding(code, count, name) for code, count in by_code.items() if count]
    if found.damaged:
        counted.append(finding("raster-damaged", len(found.damaged), names_text([Path(path).name for path in found.damaged])))
    return {
        **counts,
        "format": CLASS,
        "findings": [*counts.get("findings", []), *rasters.findings(), *counted, *rasters.exactness()],
        "crs": rasters.crs_wkt,
        "projection": {**rasters.scene_from_base.report, "heights": "unchanged"},
    }


def _write_report(path: Path, report: dict[str, Any]) -> None:
    draft = path.with_suffix(".tmp")
    draft.write_text(json.dumps(report, ensure_ascii=False, indent=1) + "\n")
    os.replace(draft, path)
