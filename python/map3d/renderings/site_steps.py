"""`map3d site`: turns a folder of files into a rendering, in steps that can each be repeated."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from map3d.catalogue import Catalogue, RenderingRecord, SceneRecord, Workspace
from map3d.geometry.frames import pin
from map3d.ingest.import_options import ImportOptions
from map3d.renderings.build import open_scene
from map3d.renderings.create import RenderingRequest, create_rendering
from map3d.renderings.layers import LayerRequest
from map3d.renderings.plan import planned_occupancy
from map3d.renderings.site_files import SiteFiles
from map3d.types import ViewAngles

RESOLUTIONS_M: Final = (0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
MAX_BASE_TILES: Final = 30_000
"""For all views together: some minutes on a small machine."""

_PROBE_LEVEL: Final = 8


@dataclass(frozen=True)
class SiteRequest:
    """`choose_res` selects the resolution when `res_m` is None."""

    name: str
    sources: Path
    views: Sequence[ViewAngles]
    res_m: float | None = None
    title: str = ""
    attribution: str = ""
    color: str = "webp"
    options: ImportOptions = field(default_factory=ImportOptions)
    allow_empty: bool = False

    @property
    def files(self) -> SiteFiles:
        return SiteFiles(SceneRecord(self.name, self.title, self.attribution), self.sources, self.options, self.allow_empty)


def create_site_rendering(workspace: Workspace, catalogue: Catalogue, request: SiteRequest) -> RenderingRecord:
    """Returns the rendering of the site, and creates it when it does not exist; its scene must be built."""
    for record in catalogue.renderings(request.name):
        if record.name == request.name:
            return record
    res_m = request.res_m or choose_res(workspace, request)
    layers = LayerRequest(color=request.color)
    rendering = RenderingRequest(
        request.name, request.name, request.views, res_m, layers=layers, title=request.title, attribution=request.attribution
    )
    return create_rendering(workspace, catalogue, rendering)


def choose_res(workspace: Workspace, request: SiteRequest) -> float:
    """Returns the finest of RESOLUTIONS_M with at most MAX_BASE_TILES base tiles, estimated from the area that the scene covers in each view."""
    scene = open_scene(workspace, request.name)
    box, tile_px, covered_m2 = scene.box, 256, 0.0
    frames = pin(box, tile_px, RESOLUTIONS_M[0], request.views)
    for frame in frames:
        level = min(frame.zmax, _PROBE_LEVEL)
        side_m = frame.size_m / 2.0**level
        covered_m2 += planned_occupancy(scene, frame, level).count(level) * side_m**2
    for res_m in RESOLUTIONS_M:
        if covered_m2 / (res_m * tile_px) ** 2 <= MAX_BASE_TILES:
            return res_m
    return RESOLUTIONS_M[-1]
