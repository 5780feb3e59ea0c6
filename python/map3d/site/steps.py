"""`map3d site`: turns a folder of files into a rendering, in steps that can each be repeated."""

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from map3d import _core
from map3d.catalogue import Catalogue, RenderingRecord, SceneRecord, Workspace
from map3d.ingest.findings import Finding
from map3d.ingest.import_options import ImportOptions
from map3d.lifecycle.change_rendering import change_rendering
from map3d.lifecycle.create_rendering import create_rendering
from map3d.registry import Registry
from map3d.requests import CreateRendering, Site
from map3d.requests.renderings import DEFAULT_RADIUS_M, MapTexts
from map3d.scenes.build import GROUND, open_scene
from map3d.scenes.file_contents import file_contents, union
from map3d.scenes.outlier_lines import middle_of, outlier_lines
from map3d.scenes.outliers import read_outliers
from map3d.site.files import ImportSummary, SiteFiles
from map3d.site.later_run import LaterRun, apply_options, check_start_view
from map3d.site.report import SiteReport, read_report, view_names, write_report
from map3d.site.resolution import TERRAIN_CLASSES, Resolution, SurfaceDetail, choose_resolution, surface_detail
from map3d.types import AO_RADIUS_M, COLOR_FORMATS, DEFAULT_DATA, LAYERS_BY_DATA

AO_RADIUS_SHARE: Final = 0.25
"""Greatest radius of ambient occlusion as a share of the scene's longest side."""


def site_files(request: Site) -> SiteFiles:
    options = ImportOptions.of(request, name=None, virtual_rasters=True)
    scene = SceneRecord(request.name, request.title or _title(request), request.attribution or "")
    return SiteFiles(scene, request.folder, options, request.allow_empty)


def _title(request: Site) -> str:
    """Returns the title of a new site without one."""
    return request.folder.resolve().stem


@dataclass(frozen=True)
class SiteRendering:
    """`resolution`: None when it was given or the rendering existed; `has_chosen_ao`: ambient occlusion was chosen because textures cover less than
    a tenth of its surfaces; `changes`: of a rendering that existed."""

    record: RenderingRecord
    resolution: Resolution | None = None
    has_chosen_ao: bool = False
    changes: LaterRun | None = None


def create_site_rendering(workspace: Workspace, catalogue: Catalogue, request: Site) -> SiteRendering:
    """Creates the rendering of the site, or changes the one that exists as the request says; its scene must be built."""
    scene = open_scene(workspace, request.name)
    for record in catalogue.renderings(request.name):
        if record.name == request.name:
            changes = apply_options(workspace, catalogue, request, record, scene.box, _ao_radius_m(scene))
            return SiteRendering(changes.record, changes=changes)
    check_start_view(request, request.angles())
    detail = _surface_detail(workspace, request.name, scene)
    resolution = None if request.res_m else choose_resolution(scene, list(request.angles()), detail)
    res_m = request.res_m if resolution is None else resolution.res_m
    has_chosen_ao = request.ao is None and detail is not None and detail.texel_m is None
    names = LAYERS_BY_DATA[request.data or DEFAULT_DATA] + (("ao",) if request.ao or has_chosen_ao else ())
    rendering = CreateRendering(
        scene=request.name,
        name=request.name,
        views=request.angles(),
        res_m=res_m,
        layers=names,
        color=request.color or COLOR_FORMATS[0],
        small=bool(request.small),
        radius_m=_ao_radius_m(scene) if "ao" in names else None,
        title=request.title or _title(request),
        attribution=request.attribution or "",
    )
    record = create_rendering(workspace, catalogue, rendering)
    if request.description is not None or request.start_view is not None:
        record = change_rendering(workspace, catalogue, record.name, MapTexts(description=request.description, start_view=request.start_view))
    return SiteRendering(record, resolution, has_chosen_ao)


def _ao_radius_m(scene: _core.Scene) -> float:
    """Returns the radius of ambient occlusion: a smaller one for single buildings and finds, which would be dark all over."""
    lo, hi = scene.box
    longest_m = max(high - low for low, high in zip(lo, hi, strict=True))
    return max(min(DEFAULT_RADIUS_M, AO_RADIUS_SHARE * longest_m), AO_RADIUS_M[0])


def store_report(
    workspace: Workspace,
    catalogue: Catalogue,
    request: Site,
    made: SiteRendering,
    summary: ImportSummary,
    workers: int,
    seconds: float | None,
) -> None:
    """Stores the report of the site for its publications. `seconds`: that rendering took, None when there was nothing to render."""
    scene, record = catalogue.scene(request.name), made.record
    files = tuple(file_contents(workspace, catalogue, request.name))
    box = union([file.box for file in files])
    folder = request.folder
    report = SiteReport(
        title=record.title or record.name,
        crs=None if scene.crs is None else scene.crs.name,
        place="" if box is None else str(middle_of(box, scene.crs)),
        box=box,
        files=tuple(replace(file, findings=tuple(_published(finding, file.source, folder) for finding in file.findings)) for file in files),
        failed=tuple((_without_folder(file, folder), _without_folder(str(reason), folder)) for file, reason in summary.failed),
        ignored=tuple(summary.ignored),
        left_out=tuple(map(str, outlier_lines(read_outliers(workspace, request.name), scene.crs))),
        views=view_names([frame.angles for frame in record.frames]),
        res_m=record.res_m,
        why="" if made.resolution is None else made.resolution.why,
        workers=workers,
    )
    write_report(workspace, record.name, report.with_run(seconds, read_report(workspace, record.name)))


def _published(finding: Finding, source: str, folder: Path) -> Finding:
    return replace(finding, example=_without_folder(finding.example, folder).removeprefix(f"{source}: "))


def _without_folder(text: str, folder: Path) -> str:
    """Returns a text without the path of the folder: a published report does not say where files are on this machine."""
    for path in {folder.absolute(), folder.resolve()}:
        if path != path.parent:
            text = text.replace(f"{path}{os.sep}", "")
    return text


def _surface_detail(workspace: Workspace, name: str, scene: _core.Scene) -> SurfaceDetail | None:
    with Registry(workspace.registry_path(name)) as registry:
        ground, terrain = registry.get_or_create_scene_object(GROUND, "terrain"), registry.ids_of_classes(TERRAIN_CLASSES)
    objects, areas_m2, texels_m = scene.sample_surfaces()
    own = objects != ground
    return surface_detail(areas_m2[own], texels_m[own], np.isin(objects[own], terrain))
