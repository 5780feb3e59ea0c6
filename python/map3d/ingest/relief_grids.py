"""Rasters that the RasterReliefs of CityGML files name: each becomes part of the terrain of the import, as if the user had given it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from map3d.errors import UnknownFormat
from map3d.formats.detect import detect_format
from map3d.formats.raster import RASTER
from map3d.ingest.sources import SourceDocument, find_sources

Grid = Mapping[str, Any]
"""Where a raster is, as its RasterRelief says; see `grids` in map3d._core.Reader."""


class ReliefGrids:
    """Collects the rasters that imported documents name, and gives them to the terrains that are imported after these."""

    def __init__(self) -> None:
        self._grids: dict[Path, Grid] = {}
        self.is_waiting = False
        """Grids were collected that are not placed."""

    def collect(self, grids: Iterable[Grid]) -> None:
        """Adds the grids of a document; of several for one raster, the first counts."""
        for grid in grids:
            self._grids.setdefault(Path(grid["file"]).resolve(), grid)
            self.is_waiting = True

    def place(self, terrains: Sequence[SourceDocument], names: Mapping[str, Path]) -> tuple[list[SourceDocument], list[tuple[str, str]]]:
        """Returns the terrains with the rasters that the grids name, and the files that are no rasters, with the reason. A raster that no terrain has
        joins the first one; without any, it is one of its own. `names`: the files of assets by name."""
        self.is_waiting = False
        found = {path.resolve() for terrain in terrains for path in terrain.data_paths}
        missing, failed = [], []
        for file in self._grids:
            try:
                if file in found or detect_format(file) is RASTER:
                    missing += [file] if file not in found else []
                else:
                    failed.append((str(file), "a RasterRelief names it as its raster, but it is none"))
            except UnknownFormat as error:
                failed.append((str(file), str(error)))
        if missing and terrains:
            first = terrains[0]
            terrains = [replace(first, paths=(*first.paths, *missing), places=(*first.places, *missing)), *terrains[1:]]
        elif missing:
            terrains = find_sources(missing, known=names, taken=[name for name, path in names.items() if path.is_file()])
        return [self._with_grids(terrain) for terrain in terrains], failed

    def _with_grids(self, terrain: SourceDocument) -> SourceDocument:
        """Adds the grids of its rasters."""
        grids = {path: self._grids[path.resolve()] for path in terrain.data_paths if path.resolve() in self._grids}
        return replace(terrain, grids=grids) if grids else terrain
