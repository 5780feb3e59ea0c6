"""Brings the scene of a site in line with its folder: imports new and changed files, and removes those that have left the folder."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from map3d.catalogue import AssetRecord, Catalogue, SceneRecord, Workspace
from map3d.catalogue.scene_lock import scene_lock
from map3d.coherence.check import check_scene, choose_heights
from map3d.coherence.height_rules import NO_CLASSES
from map3d.coherence.photo_ground import ground_change, photo_ground
from map3d.coherence.plan import ImportPlan, plan_import
from map3d.errors import BadRequest, Map3dError, UnknownFormat
from map3d.formats.raster import RASTER
from map3d.ingest.asset_removal import remove_assets, removed_files
from map3d.ingest.file_notes import HEIGHTS_ALONE, FileNote, is_decided
from map3d.ingest.import_inputs import import_inputs
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import OnlyGrids, OnProgress, import_file
from map3d.ingest.parser_process import ParserProcess
from map3d.ingest.relief_grids import ReliefGrids
from map3d.ingest.sources import SourceDocument, find_sources
from map3d.ingest.unfinished_imports import finish_imports
from map3d.ingest.unpacked_archives import UnpackedFiles, unpacked
from map3d.lifecycle.remove_files import remove_built_files
from map3d.lifecycle.remove_scene import finish_scene_removal
from map3d.messages import Message, message, verbatim
from map3d.requests.heights import BY_EVIDENCE

OnSource = Callable[[str, int, int, Message | None], None]
"""Called with the name of the current file, the number of files done, and of all, and what was read of the file so far."""


@dataclass(frozen=True)
class SiteFiles:
    """The folder of a site and how its files are imported. `allow_empty`: accepts an empty folder, from which files seem to have vanished."""

    scene: SceneRecord
    folder: Path
    options: ImportOptions = field(default_factory=ImportOptions)
    allow_empty: bool = False


@dataclass(frozen=True)
class ImportSummary:
    """Names of assets. `again`: those of `imported` that existed, with the reason; `failed`: (file, reason); `elsewhere`: assets from other folders,
    which stay; `ignored`: files of the folder that are no documents of their own."""

    imported: list[str] = field(default_factory=list)
    again: dict[str, str] = field(default_factory=dict)
    unchanged: list[str] = field(default_factory=list)
    failed: list[tuple[str, Message]] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    elsewhere: list[str] = field(default_factory=list)
    ignored: list[FileNote] = field(default_factory=list)


def update_files(workspace: Workspace, catalogue: Catalogue, files: SiteFiles, report: OnSource) -> ImportSummary:
    """Creates the scene when it does not exist, imports what is new or depends on something that changed, and removes what has left the folder.

    A broken file is reported and skipped; its asset, if there is one, stays as it is, which is said. Raises BadRequest when no file is usable, or
    when files have vanished from a folder that is empty now, as that of an unmounted disk is; NotFound for a folder that cannot be read. Then nothing
    is removed.
    """
    if not any(scene.name == files.scene.name for scene in catalogue.scenes()):
        finish_scene_removal(workspace, catalogue, files.scene.name)
        catalogue.create_scene(files.scene)
    with scene_lock(workspace, files.scene.name):
        finish_imports(workspace, catalogue, files.scene.name)
    choose_heights(catalogue, files.scene.name, files.options.heights or BY_EVIDENCE, files.options.clamp or (NO_CLASSES,))
    with unpacked(workspace, files.scene.name, [files.folder], report) as found:
        summary = _Update(workspace, catalogue, files, found).run(report)
    check_scene(workspace, catalogue, files.scene.name)
    return summary


class _Update:
    def __init__(self, workspace: Workspace, catalogue: Catalogue, files: SiteFiles, unpacked: UnpackedFiles) -> None:
        self._workspace, self._catalogue, self._files, self._unpacked = workspace, catalogue, files, unpacked
        self._assets = {asset.name: asset for asset in catalogue.assets(files.scene.name)}
        self._root = files.folder.resolve()
        self._summary = ImportSummary()
        self._decided: set[Path] = set()
        """Files that are there and no documents, since others use them or have their content."""
        self._emptied: list[str] = []
        """Assets whose files have nothing to draw now but rasters."""
        self._grids = ReliefGrids()
        self._plan = ImportPlan((), {})

    def run(self, report: OnSource) -> ImportSummary:
        self._plan = plan_import(self._find_sources(), self._files.options, self._catalogue.scene(self._files.scene.name))
        sources = self._plan.sources
        leaving = list(self._leaving(sources))
        self._check_vanished(leaving)
        self._summary.elsewhere.extend(name for name, asset in self._assets.items() if not self._is_inside(asset) and name not in _names(sources))
        with ParserProcess() as parser:
            for number, found in enumerate(sources):
                source = self._with_grids(found) if found.format == RASTER.name and self._grids.is_waiting else found
                show = partial(report, source.paths[0].name, number, len(sources))
                show(None)
                self._import_if_changed(source, parser, show)
            self._import_other_rasters(parser, report)
        if sources and not self._summary.imported and not self._summary.unchanged:
            files = "its only file is not usable" if len(sources) == 1 else f"none of its {len(sources)} files is usable; first error"
            raise BadRequest(f"{self._files.folder}: {files}: {self._summary.failed[0][1]}")
        self._remove([asset.name for asset in leaving] + self._emptied)
        self._say_what_stays(sources)
        return self._summary

    def _find_sources(self) -> list[SourceDocument]:
        try:
            sources = find_sources(
                [self._files.folder],
                None,
                self._fail,
                self._leave_alone,
                {name: Path(asset.source) for name, asset in self._assets.items()},
                [self._files.folder] if self._files.options.virtual_rasters else (),
                removed=removed_files(self._workspace, self._files.scene.name),
                unpacked=self._unpacked,
            )
        except UnknownFormat as error:
            from_here = sum(map(self._is_inside, self._assets.values()))
            if not from_here:
                raise
            if self._files.allow_empty:
                return []
            raise BadRequest(
                f"{error}; but the scene {self._files.scene.name} has {from_here} files from there, so perhaps a disk is not mounted. "
                "If they are gone for good, run again with --allow-empty"
            ) from error
        if self._summary.failed and self._files.options.strict:
            raise UnknownFormat(self._summary.failed[0][1])
        return sources

    def _leave_alone(self, path: Path, note: Message) -> None:
        place = self._unpacked.place(path)
        if is_decided(note):
            self._decided.add(place.absolute())
        self._summary.ignored.append((str(place.relative_to(self._files.folder)), note))

    def _fail(self, path: Path, reason: Message) -> None:
        self._summary.failed.append((str(self._unpacked.place(path)), reason.map_texts(self._unpacked.original)))

    def _is_inside(self, asset: AssetRecord) -> bool:
        path = Path(asset.source)
        return (path.parent.resolve() / path.name).is_relative_to(self._root)

    def _leaving(self, sources: Sequence[SourceDocument]) -> Iterator[AssetRecord]:
        """Yields the assets whose file has left the folder, is imported under another name, or is no document now. A file that is there but
        unreadable has not left."""
        names, imported = _names(sources), {path.absolute() for source in sources for path in source.places}
        for asset in self._assets.values():
            path = Path(asset.source)
            has_left = path in imported or path in self._decided or not self._unpacked.is_there(path)
            if asset.name not in names and self._is_inside(asset) and has_left:
                yield asset

    def _say_what_stays(self, sources: Sequence[SourceDocument]) -> None:
        """Says of each file that cannot be read now that the scene keeps what it held before."""
        done = {*self._summary.imported, *self._summary.unchanged, *self._summary.removed}
        places = {source.name: source.place for source in sources}
        old = {name: Path(asset.source) for name, asset in self._assets.items() if name not in done and self._is_inside(asset)}
        stays = {places.get(name, path).absolute() for name, path in old.items()}
        failed = []
        for file, reason in self._summary.failed:
            own = {path for path in stays if path.is_relative_to(Path(file).absolute())}
            failed.append((file, message("failed-with-earlier-content", reason=reason) if own else reason))
            stays -= own
        said = [(str(path), message("about", what=str(path), message=message("earlier-content-stays"))) for path in sorted(stays)]
        self._summary.failed[:] = [*failed, *said]

    def _check_vanished(self, leaving: Sequence[AssetRecord]) -> None:
        """Raises BadRequest when files came from a folder that exists and is empty now."""
        vanished: dict[Path, int] = {}
        for asset in leaving:
            folder = _nearest_folder(Path(asset.source))
            vanished[folder] = vanished.get(folder, 0) + 1
        for folder, count in vanished.items():
            if _is_empty(folder) and not self._files.allow_empty:
                raise BadRequest(
                    f"{folder}: is empty, but {count} files of the scene {self._files.scene.name} came from there, so perhaps a disk is not mounted. "
                    "If they are gone for good, remove the empty folder or run again with --allow-empty"
                )

    def _import_if_changed(self, source: SourceDocument, parser: ParserProcess, show: OnProgress) -> None:
        asset, options = self._assets.get(source.name), self._plan.options(source, self._files.options)
        scene = self._files.scene.name
        try:
            reason = None
            ground = photo_ground(self._workspace, self._catalogue, scene) if source.format == RASTER.name else None
            if asset is not None:
                reason = import_inputs(source, options).changes(asset) or ground_change(asset, ground)
                if reason is None:
                    self._keep(asset, source)
                    self._grids.collect(asset.report.get("grids", ()))
                    return
            done = import_file(self._workspace, self._catalogue, scene, source, options, show, parser=parser, ground=ground)
            self._grids.collect(done.report.get("grids", ()))
        except OnlyGrids as found:
            self._grids.collect(found.grids)
            self._leave_alone(source.paths[0], message(HEIGHTS_ALONE))
            if asset is not None:
                self._emptied.append(source.name)
            return
        except Map3dError as error:
            if self._files.options.strict:
                raise
            self._fail(source.paths[0], error.message)
            return
        self._summary.imported.append(source.name)
        if reason is not None:
            self._summary.again[source.name] = reason

    def _with_grids(self, terrain: SourceDocument) -> SourceDocument:
        """Places the rasters of the folder, which are one terrain, where the documents say."""
        (placed,), failed = self._grids.place([terrain], {})
        self._summary.failed.extend((file, verbatim(reason)) for file, reason in failed)
        return placed

    def _import_other_rasters(self, parser: ParserProcess, report: OnSource) -> None:
        """Imports the rasters that the documents name and that are no files of the folder's own terrain, such as those of hidden folders."""
        if not self._grids.is_waiting:
            return
        terrains, failed = self._grids.place([], {name: Path(asset.source) for name, asset in self._assets.items()})
        self._summary.failed.extend((file, verbatim(reason)) for file, reason in failed)
        for terrain in terrains:
            self._import_if_changed(terrain, parser, partial(report, terrain.paths[0].name, 0, len(terrains)))

    def _keep(self, asset: AssetRecord, source: SourceDocument) -> None:
        """Records where the file is now, so that its leaving is noticed even after the folder was moved."""
        self._summary.unchanged.append(source.name)
        path = str(source.place.absolute())
        if asset.source != path:
            self._catalogue.put_asset(replace(asset, source=path))

    def _remove(self, names: Sequence[str]) -> None:
        scene = self._files.scene.name
        if names:
            with scene_lock(self._workspace, scene):
                finish_imports(self._workspace, self._catalogue, scene)
                remove_assets(self._workspace, self._catalogue, scene, names)
                if not self._catalogue.assets(scene):
                    remove_built_files(self._workspace, scene)
        self._summary.removed.extend(names)


def reasons(again: Mapping[str, str]) -> dict[str, list[str]]:
    """Returns reason → names."""
    grouped: dict[str, list[str]] = {}
    for name, reason in again.items():
        grouped.setdefault(reason, []).append(name)
    return grouped


def _names(sources: Sequence[SourceDocument]) -> set[str]:
    return {source.name for source in sources}


def _nearest_folder(path: Path) -> Path:
    """Returns the deepest folder above a path that exists."""
    return next(folder for folder in path.parents if folder.is_dir())


def _is_empty(folder: Path) -> bool:
    return not any(not name.startswith(".") and name != "lost+found" for name in os.listdir(folder))
