"""Imports files and folders into a scene, one source document after another; a broken file is reported and skipped."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from map3d.catalogue import AssetRecord, Catalogue, Workspace
from map3d.catalogue.scene_lock import scene_lock
from map3d.coherence.check import check_scene, choose_file_heights
from map3d.coherence.height_rules import with_choice
from map3d.coherence.photo_ground import ground_change, photo_ground
from map3d.coherence.plan import plan_import
from map3d.errors import BadRequest, Map3dError, UnknownFormat
from map3d.formats.raster import RASTER
from map3d.ingest.asset_removal import removed_files
from map3d.ingest.file_notes import HEIGHTS_ALONE, FileNote
from map3d.ingest.ground_grid import GroundGrid
from map3d.ingest.import_inputs import import_inputs
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import Imported, OnlyGrids, import_file, workspace_key
from map3d.ingest.parser_process import ParserProcess
from map3d.ingest.relief_grids import ReliefGrids
from map3d.ingest.sources import SourceDocument, find_sources
from map3d.ingest.unfinished_imports import finish_imports
from map3d.ingest.unpacked_archives import UnpackedFiles, unpacked
from map3d.messages import Message, message, verbatim

OnFile = Callable[[str, int, int, Message | None], None]
"""Called with the name of the current file, the number of files before it, the number of all files, and what was read of it so far."""


@dataclass(frozen=True)
class FilesImport:
    """`unchanged`: names of assets that were up to date and not imported again; `failed`: (file, reason); `ignored`: files of the folders that are no
    documents of their own."""

    imported: list[Imported] = field(default_factory=list)
    unchanged: list[str] = field(default_factory=list)
    failed: list[tuple[str, Message]] = field(default_factory=list)
    ignored: list[FileNote] = field(default_factory=list)


def import_files(
    workspace: Workspace,
    catalogue: Catalogue,
    scene: str,
    files: Sequence[Path],
    options: ImportOptions,
    *,
    progress: OnFile | None = None,
) -> FilesImport:
    """Imports the files, and all files in known formats of the folders and ZIP archives, also of archives in the folders.

    `options.skip_unchanged`: leaves assets alone whose files, options and reader are the same as at their import.

    Raises NotFound, UnknownFormat, BadRequest; ImportFailed and LimitExceeded for an archive that cannot be unpacked; under `options.strict` and for
    a single file also the errors of `import_file`.
    """
    with_choice(catalogue.scene(scene).options, options.heights, options.clamp)
    with unpacked(workspace, scene, files, progress or (lambda *_: None)) as found:
        virtual = [path for path in files if options.virtual_rasters and path in found.paths]
        done = _import_files(workspace, catalogue, scene, found, virtual, options, progress)
        check_scene(workspace, catalogue, scene)
        reports = {asset.name: asset.report for asset in catalogue.assets(scene)}
        failed = [(found.original(path), reason.map_texts(found.original)) for path, reason in done.failed]
        ignored = [(found.original(path), note) for path, note in done.ignored]
        imported = [replace(item, report=reports.get(item.asset, item.report)) for item in done.imported]
        return FilesImport(imported, done.unchanged, failed, ignored)


def _import_files(
    workspace: Workspace,
    catalogue: Catalogue,
    scene: str,
    found: UnpackedFiles,
    virtual: Sequence[Path],
    options: ImportOptions,
    progress: OnFile | None,
) -> FilesImport:
    result = FilesImport()
    assets = catalogue.assets(scene)
    sources = find_sources(
        found.paths,
        options.name,
        lambda path, reason: result.failed.append((str(path), reason)),
        lambda path, note: result.ignored.append((str(path), note)),
        {asset.name: Path(asset.source) for asset in assets},
        virtual,
        _taken_names(workspace, assets, found.paths),
        removed_files(workspace, scene),
        found,
    )
    if result.failed and options.strict:
        raise UnknownFormat(result.failed[0][1])
    if options.name is not None and len(sources) > 1:
        raise BadRequest(f"--name {options.name}: applies to a single file, got {len(sources)}")
    is_single = len(sources) + len(result.failed) == 1
    known = _known_assets(workspace, catalogue, scene) if options.skip_unchanged else {}
    grids = ReliefGrids()
    plan = plan_import(sources, options, catalogue.scene(scene))
    choose_file_heights(catalogue, scene, [source.name for source in sources], options.heights, options.clamp)
    waiting, number = list(plan.sources), 0
    with ParserProcess() as parser:
        while waiting or grids.is_waiting:
            if grids.is_waiting and (not waiting or waiting[0].format == RASTER.name):
                names = {asset.name: Path(asset.source) for asset in catalogue.assets(scene)}
                waiting, failed = grids.place(waiting, names)
                result.failed.extend((file, verbatim(reason)) for file, reason in failed)
                continue
            source = waiting.pop(0)
            show = _show(progress, source.paths[0].name, number, number + len(waiting) + 1)
            show(None)
            number += 1
            chosen = plan.options(source, options)
            try:
                ground = photo_ground(workspace, catalogue, scene) if source.format == RASTER.name else None
                if _is_unchanged(known.get(source.name), source, chosen, ground):
                    result.unchanged.append(source.name)
                    grids.collect(known[source.name].report.get("grids", ()))
                else:
                    done = import_file(workspace, catalogue, scene, source, chosen, show, parser=parser, ground=ground)
                    result.imported.append(done)
                    grids.collect(done.report.get("grids", ()))
            except OnlyGrids as empty:
                grids.collect(empty.grids)
                result.ignored.append((str(source.paths[0]), message(HEIGHTS_ALONE)))
            except Map3dError as error:
                if options.strict or (is_single and not result.imported and not result.unchanged):
                    raise
                result.failed.append((str(source.paths[0]), error.message))
    return result


def _taken_names(workspace: Workspace, assets: Sequence[AssetRecord], files: Sequence[Path]) -> set[str]:
    """Returns the names of assets whose files this workspace imported from outside of itself and that are still there. A workspace that is a copy
    has no such names, since its assets are those of the other one; nor has an import of files inside the workspace, such as uploads."""
    root = workspace.root.resolve()
    if any(path.resolve().is_relative_to(root) for path in files):
        return set()
    imported_here = (asset for asset in assets if asset.report.get("workspace") == workspace_key(workspace))
    sources = {asset.name: Path(asset.source) for asset in imported_here}
    return {name for name, path in sources.items() if path.is_file() and not path.resolve().is_relative_to(root)}


def _known_assets(workspace: Workspace, catalogue: Catalogue, scene: str) -> dict[str, AssetRecord]:
    """Returns the assets by name, after completing imports that were killed."""
    with scene_lock(workspace, scene):
        finish_imports(workspace, catalogue, scene)
    return {asset.name: asset for asset in catalogue.assets(scene)}


def _is_unchanged(asset: AssetRecord | None, source: SourceDocument, options: ImportOptions, ground: GroundGrid | None) -> bool:
    return asset is not None and import_inputs(source, options).changes(asset) is None and ground_change(asset, ground) is None


def _show(progress: OnFile | None, name: str, number: int, total: int) -> Callable[[Message | None], None]:
    return lambda how_far: None if progress is None else progress(name, number, total, how_far)
