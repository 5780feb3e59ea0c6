"""Imports one source document as an asset of a scene: a limited subprocess parses it, and one atomic step puts the asset in place."""

import hashlib
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial, reduce
from pathlib import Path
from typing import Any, Final

from map3d import _core, errors
from map3d.catalogue import AssetRecord, Catalogue, SceneCrs, SceneRecord, Workspace
from map3d.catalogue.scene_lock import scene_lock
from map3d.cores import usable_cores
from map3d.errors import CrsError, ImportFailed, LimitExceeded, Map3dError, SubprocessDied, SubprocessTimedOut
from map3d.formats import find_format
from map3d.ingest.asset import asset_digest, new_objects, put_in_place, read_objects, world_boxes, write_ids, write_report
from map3d.ingest.content import find_content
from map3d.ingest.file_notes import HEIGHTS_ALONE
from map3d.ingest.findings import findings
from map3d.ingest.ground_grid import GroundGrid
from map3d.ingest.import_checkpoints import checkpoints_key, import_checkpoints
from map3d.ingest.import_inputs import ImportInputs, import_inputs
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.import_progress import ImportProgress
from map3d.ingest.parser_process import ParserProcess
from map3d.ingest.relief_grids import Grid
from map3d.ingest.scene_crs import LOCAL
from map3d.ingest.sources import SourceDocument
from map3d.ingest.unfinished_imports import draft_path, finish_imports, mark_import, remove_dead_drafts, unmark_import
from map3d.messages import Message, message
from map3d.registry import Registry
from map3d.subprocess import Failure, Limits
from map3d.types import Box, Vec3

ORIGIN_STEP_M: Final = 100.0
MAX_MISSING_NAMES: Final = 200
MAX_FROM_ORIGIN_M: Final = _core.MAX_FROM_ORIGIN_M

_NOT_IN_PIECES: Final = ("strict", "max_object_bytes", "max_appearance_bytes")
"""Options on which the checkpoints of a terrain do not depend."""

OnProgress = Callable[[Message], None]
"""Called with the number of triangles or tiles read so far, as text."""


@dataclass(frozen=True)
class Imported:
    """Result of an import. `report`: counts by reason, and how the coordinates were transformed."""

    asset: str
    source: str
    format: str
    objects: int
    triangles: int
    replaced: bool
    report: Mapping[str, Any]


class OnlyGrids(ImportFailed):
    """The document has nothing to draw but rasters of reliefs, which are imported as terrain; it is no asset."""

    def __init__(self, message: Message, grids: Sequence[Grid]) -> None:
        super().__init__(message)
        self.grids = grids


def import_file(
    workspace: Workspace,
    catalogue: Catalogue,
    scene: str,
    source: SourceDocument,
    options: ImportOptions,
    progress: OnProgress | None = None,
    *,
    parser: ParserProcess | None = None,
    entry: str | None = None,
    ground: GroundGrid | None = None,
) -> Imported:
    """Adds a source document to a scene, or replaces the asset of the same name. The report counts partial failures.

    `parser`: a subprocess to reuse for many files; by default a new one parses this file. `ground`: below a photo without elevation model.

    Raises ImportFailed (nothing usable, or the first fault under `strict`), OnlyGrids, LimitExceeded, CrsError. Until the last step the scene is
    unchanged.
    """
    record = catalogue.scene(scene)
    final = workspace.asset_folder(scene, source.name)
    draft = draft_path(final)
    inputs = import_inputs(source, options)
    remove_dead_drafts(final.parent)
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    try:
        with _checkpoints(record, source, final, inputs, ground) as checkpoints:
            with parser or ParserProcess() as running:
                known = next((asset for asset in catalogue.assets(scene) if asset.name == source.name), None)
                parse = partial(_parse, record, source, options, inputs.of_last_import(known), draft, checkpoints, progress, running)
                parsed = parse(entry or find_format(source.format).parser, ground)
            report = parsed["report"]
            if not report["triangles"] and report.get("grids"):
                raise OnlyGrids(message("about", what=str(source.paths[0]), message=message(HEIGHTS_ALONE)), report["grids"])
            if not report["triangles"]:
                raise ImportFailed(_without_triangles(source, report))
            with scene_lock(workspace, scene):
                finish_imports(workspace, catalogue, scene)
                proposed = None if parsed["crs"] is None else SceneCrs(**parsed["crs"])
                return _add_to_scene(workspace, catalogue, record, source, draft, report, proposed, inputs)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _checkpoints(
    record: SceneRecord, source: SourceDocument, final: Path, inputs: ImportInputs, ground: GroundGrid | None
) -> AbstractContextManager[Path | None]:
    """Returns the folder for the checkpoints of an import; None for a format that is imported as a whole."""
    if not find_format(source.format).has_checkpoints:
        return nullcontext()
    options = {name: value for name, value in inputs.options.items() if name not in _NOT_IN_PIECES}
    paths = [str(path.absolute()) for path in source.places or source.paths]
    key = {"files": inputs.files, "paths": paths, "options": options, "reader": inputs.reader, "scene_crs": _crs_text(record.crs)}
    key |= {} if ground is None else {"ground": ground.digest}
    return import_checkpoints(final, checkpoints_key(key))


def _parse(
    record: SceneRecord,
    source: SourceDocument,
    options: ImportOptions,
    last: Mapping[str, Any],
    draft: Path,
    checkpoints: Path | None,
    progress: OnProgress | None,
    parser: ParserProcess,
    entry: str,
    ground: GroundGrid | None,
) -> dict[str, Any]:
    limits = options.limits(source.data_paths, source.format)
    request = {
        "path": str(source.paths[0].absolute()),
        "paths": [str(path.absolute()) for path in source.paths],
        "name": source.name,
        "format": source.format,
        "folder": str(draft.absolute()),
        "reader": options.reader_options(source.format, limits) | dict(last) | _folder_options(source),
        "crs": options.crs,
        "placing": options.placing,
        "scene_crs": _crs_text(record.crs),
        "scene_origin": record.origin,
        "checkpoints": None if checkpoints is None else str(checkpoints.absolute()),
        "cores": usable_cores(),
        "grids": {str(path.absolute()): grid for path, grid in source.grids.items()},
        "place": _place(source),
        "ground": None if ground is None else ground.document,
        "virtual": {str(path.absolute()): str(folder.absolute()) for path, folder in source.virtual_folders.items()},
    }
    shown = ImportProgress()
    try:
        subprocess, applied = parser.get(entry, limits)
        answer = subprocess.request(request, wall_s=limits.wall_s, on_progress=lambda counts: counts and progress and progress(shown.message(counts)))
    except (SubprocessDied, LimitExceeded) as error:
        parser.stop()
        raise _parser_error(source, limits, error) from error
    except BaseException:
        parser.stop()
        raise
    if isinstance(answer, Failure):
        raise _failure_error(source, answer)
    response: dict[str, Any] = answer.value
    response["report"]["parser"] = {**applied, "address_space_bytes": limits.address_space_bytes, "cpu_s": limits.cpu_s}
    return response


def _add_to_scene(
    workspace: Workspace,
    catalogue: Catalogue,
    before: SceneRecord,
    source: SourceDocument,
    draft: Path,
    report: dict[str, Any],
    proposed: SceneCrs | None,
    inputs: ImportInputs,
) -> Imported:
    scene, lines = before.name, read_objects(draft)
    boxes = world_boxes(draft, len(lines))
    extent = find_content([draft], (0.0, 0.0, 0.0), {}).extent
    usual = boxes if extent is None else world_boxes(draft, len(lines), extent)
    record = _pin_scene(catalogue, before, proposed, usual)
    assert record.origin is not None, "the scene is pinned"
    _check_distance(source, usual, record.origin)
    final, path = workspace.asset_folder(scene, source.name), str(source.place.absolute())
    mark_import(final, path, source.format, inputs.digest)
    with Registry(workspace.registry_path(scene)) as registry:
        ids = registry.put_asset(source.name, new_objects(lines, boxes, record.origin))
    write_ids(draft, ids)
    report |= inputs.report() | _missing_files(source) | {"bytes": sum(path.stat().st_size for path in source.data_paths)}
    report["workspace"] = workspace_key(workspace)
    write_report(draft, report)
    replaced = final.exists()
    digest = asset_digest(draft)
    put_in_place(draft, final)
    catalogue.put_asset(AssetRecord(scene, source.name, path, source.format, digest, inputs.digest, report))
    unmark_import(final)
    return Imported(source.name, str(source.place), source.format, len(lines), report["triangles"], replaced, report)


def workspace_key(workspace: Workspace) -> str:
    """Returns what tells this workspace from a copy of it: a hash of its place."""
    return hashlib.sha256(str(workspace.root.resolve()).encode()).hexdigest()[:16]


def _folder_options(source: SourceDocument) -> dict[str, Any]:
    """Returns the folder in which the reader opens files that the document names, by default the document's own, and the files in it that have
    appearances for the document."""
    folder = {"folder": str(source.root.absolute())} if source.root is not None and find_format(source.format).names_files else {}
    return folder | ({"appearance_files": [str(path.absolute()) for path in source.appearances]} if source.appearances else {})


def _place(source: SourceDocument) -> dict[str, Any] | None:
    """Returns what files beside a model say of its place."""
    found = find_format(source.format).find_place(source.paths[0], source.root)
    if found is None:
        return None
    unreadable = None if found.unreadable is None else found.unreadable.name
    return {"offset": found.offset, "crs": found.crs, "files": [path.name for path in found.files], "unreadable": unreadable}


def _missing_files(source: SourceDocument) -> dict[str, Any]:
    """Returns the first names of missing files, and how many of the images are missing."""
    found = find_format(source.format).find_missing(source.paths[0], source.root)
    textures = {"textures": {"images": found.images, "missing": found.missing_images}} if found.images else {}
    return textures | ({"missing_files": found.names[:MAX_MISSING_NAMES]} if found.names else {})


def _pin_scene(catalogue: Catalogue, before: SceneRecord, proposed: SceneCrs | None, boxes: list[Box | None]) -> SceneRecord:
    record = catalogue.pin_scene(before.name, crs=proposed or LOCAL, origin=choose_origin(boxes))
    if before.crs is None and record.crs is not None and proposed is not None and record.crs.wkt != proposed.wkt:
        raise CrsError(
            f"scene {before.name}: another import set its CRS to {record.crs.name} while this file was read for {proposed.name}; add the file again"
        )
    return record


def choose_origin(boxes: list[Box | None]) -> Vec3:
    """Returns the horizontal centre and the lowest height of the content, rounded to 100 m: exact on the scene's lattice of 2^-12 m."""
    content = [box for box in boxes if box is not None]
    if not content:
        return (0.0, 0.0, 0.0)
    x, y = (_round_to_step((min(box[0][k] for box in content) + max(box[1][k] for box in content)) / 2) for k in (0, 1))
    return (x, y, _round_to_step(min(box[0][2] for box in content)))


def _round_to_step(value: float) -> float:
    return round(value / ORIGIN_STEP_M) * ORIGIN_STEP_M + 0.0


def _check_distance(source: SourceDocument, boxes: list[Box | None], origin: Vec3) -> None:
    for box in boxes:
        if box is not None and max(abs(corner[k] - origin[k]) for corner in box for k in range(3)) > MAX_FROM_ORIGIN_M:
            raise LimitExceeded(
                f"{source.paths[0]}: content at {box[0]} is more than {MAX_FROM_ORIGIN_M / 1000:,.0f} km from the scene's origin {origin}; "
                "check the file's CRS (--crs)"
            )


def _crs_text(crs: SceneCrs | None) -> str | None:
    if crs is None:
        return None
    return "local" if crs.wkt is None else crs.wkt


def _without_triangles(source: SourceDocument, report: Mapping[str, Any]) -> Message:
    file, every = str(source.paths[0]), findings(report)
    found = [item for item in every if item.skipped or item.failed_file or item.reason.code == "nothing-at-lod"]
    if not found:
        return message("no-usable-triangle", file=file)
    said = [item.message for item in found] if len(found) > 1 else [found[0].line]
    return message("no-usable-triangle-since", file=file, findings=reduce(lambda first, second: message("both", first=first, second=second), said))


def _parser_error(source: SourceDocument, limits: Limits, error: SubprocessDied | LimitExceeded) -> ImportFailed | LimitExceeded:
    if isinstance(error, LimitExceeded):
        return LimitExceeded(f"{source.paths[0]}: {error}; raise the limit with --parse-memory or --parse-cpu")
    if isinstance(error, SubprocessTimedOut) and limits.wall_s is not None:
        return LimitExceeded(f"{source.paths[0]}: parsing took longer than {limits.wall_s:g} s; raise the limit with --parse-cpu")
    return ImportFailed(message("parser-crashed", file=str(source.paths[0]), reason=error.message))


def _failure_error(source: SourceDocument, failure: Failure) -> Map3dError:
    kinds: dict[str, type[Map3dError]] = {"CrsError": CrsError, "LimitError": LimitExceeded, "LimitExceeded": LimitExceeded}
    path, said = str(source.paths[0]), failure.message
    about = said if path in str(said) else message("about", what=path, message=said)
    if failure.kind in kinds:
        return kinds[failure.kind](about)
    known = failure.kind in ("FormatError", "StorageError", "InvalidArgument") or hasattr(errors, failure.kind)
    return ImportFailed(about if known else f"{path}: {failure.kind}: {said}")
