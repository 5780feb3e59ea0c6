"""`map3d site`: turns a folder of files into a rendering, in steps that can each be repeated."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from map3d.catalogue import Catalogue, RenderingRecord, SceneRecord, Workspace
from map3d.errors import BadRequest, Map3dError, UnknownFormat
from map3d.geometry.frames import pin
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import import_file
from map3d.ingest.parser_process import ParserProcess
from map3d.ingest.sources import SourceDocument, find_sources, source_digest
from map3d.renderings.build import open_scene
from map3d.renderings.create import RenderingRequest, create_rendering
from map3d.renderings.layers import LayerRequest
from map3d.renderings.plan import planned_occupancy
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


@dataclass(frozen=True)
class ImportSummary:
    """The assets that were imported or unchanged, and (file, reason) of those that failed."""

    imported: list[str]
    unchanged: list[str]
    failed: list[tuple[str, str]]


def import_changed_files(workspace: Workspace, catalogue: Catalogue, request: SiteRequest, report: Callable[[str, int, int], None]) -> ImportSummary:
    """Creates the scene when it does not exist, and imports new and changed files; a broken file is reported and skipped. Raises BadRequest when no
    file is usable."""
    if not any(scene.name == request.name for scene in catalogue.scenes()):
        catalogue.create_scene(SceneRecord(request.name, request.title, request.attribution))
    digests = {asset.name: asset.source_digest for asset in catalogue.assets(request.name)}
    summary = ImportSummary([], [], [])
    sources = find_sources([request.sources], None, lambda path, reason: summary.failed.append((str(path), reason)))
    if summary.failed and request.options.strict:
        raise UnknownFormat(summary.failed[0][1])
    with ParserProcess() as parser:
        for number, source in enumerate(sources):
            report(source.paths[0].name, number, len(sources))
            _import_changed(workspace, catalogue, request, source, digests, summary, parser)
    if not summary.imported and not summary.unchanged:
        raise BadRequest(f"{request.sources}: none of its {len(sources)} files is usable; first error: {summary.failed[0][1]}")
    return summary


def _import_changed(
    workspace: Workspace,
    catalogue: Catalogue,
    request: SiteRequest,
    source: SourceDocument,
    digests: dict[str, str],
    summary: ImportSummary,
    parser: ParserProcess,
) -> None:
    if digests.get(source.name) == source_digest(source):
        summary.unchanged.append(source.name)
        return
    try:
        import_file(workspace, catalogue, request.name, source, request.options, parser=parser)
        summary.imported.append(source.name)
    except Map3dError as error:
        if request.options.strict:
            raise
        summary.failed.append((str(source.paths[0]), str(error)))


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
