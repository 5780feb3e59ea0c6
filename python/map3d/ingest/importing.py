"""Import: one source document becomes an asset of a scene, read by a limited child, put in place in one step."""

import os
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from map3d import errors
from map3d.catalogue import AssetRecord, Catalogue, SceneCrs, SceneRecord, Workspace
from map3d.catalogue.scene_lock import scene_lock
from map3d.errors import CrsError, ImportFailed, LimitExceeded, Map3dError, SubprocessDied, SubprocessTimedOut
from map3d.ingest.asset import asset_digest, new_objects, put_in_place, read_objects, world_boxes, write_ids, write_report
from map3d.ingest.crs import LOCAL, is_local, parse_crs, scene_crs
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.parser_process import Parsers
from map3d.ingest.sources import Source, source_digest
from map3d.registry import Registry
from map3d.subprocess import Failure, Limits
from map3d.types import Box, Vec3

ENTRIES: Final = {"raster": "map3d.ingest.terrain.parse_terrain:open_terrain"}
IMPORT_ENTRY: Final = "map3d.ingest.parse_document:open_import"
ORIGIN_STEP_M: Final = 100.0
MAX_FROM_ORIGIN_M: Final = 1e8

Progress = Callable[[str], None]
"""Called with how far the reading is, as text."""


@dataclass(frozen=True)
class Imported:
    """What an import did. `report`: counts by reason and how the coordinates were placed."""

    asset: str
    source: str
    format: str
    objects: int
    triangles: int
    replaced: bool
    report: Mapping[str, Any]


def import_file(
    workspace: Workspace,
    catalogue: Catalogue,
    scene: str,
    source: Source,
    options: ImportOptions,
    progress: Progress | None = None,
    *,
    parsers: Parsers | None = None,
    entry: str | None = None,
) -> Imported:
    """Adds a source document to a scene, or replaces the asset of its name. What went wrong in parts is counted in the report.

    `parsers`: children to use again when there are many files; else one is started for this file.

    Raises ImportFailed (nothing usable, or the first fault under `strict`), LimitExceeded, CrsError. Until the last step the scene is as before.
    """
    record = catalogue.scene(scene)
    final = workspace.asset_folder(scene, source.name)
    draft = final.with_name(f".{source.name}.{os.getpid()}.new")
    digest = source_digest(source)
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    try:
        with parsers or Parsers() as kept:
            answer = _read(record, source, options, draft, progress, kept, entry or ENTRIES.get(source.format, IMPORT_ENTRY))
        report = answer["report"]
        if not report["triangles"]:
            raise ImportFailed(f"{source.paths[0]}: no triangle in it could be used{_reasons(report)}")
        with scene_lock(workspace, scene):
            proposed = None if answer["crs"] is None else SceneCrs(**answer["crs"])
            return _adopt(workspace, catalogue, record, source, draft, report, proposed, digest)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def parse_scene_crs(text: str) -> SceneCrs:
    """A scene's system as the user names it; raises CrsError unless projected in metres, or "local"."""
    return LOCAL if is_local(text) else scene_crs(parse_crs(text))


def _read(
    record: SceneRecord, source: Source, options: ImportOptions, draft: Path, progress: Progress | None, parsers: Parsers, entry: str
) -> dict[str, Any]:
    limits = options.limits(source.paths, source.format)
    question = {
        "path": str(source.paths[0].absolute()),
        "paths": [str(path.absolute()) for path in source.paths],
        "name": source.name,
        "format": source.format,
        "folder": str(draft.absolute()),
        "reader": options.reader_options(source.format, limits),
        "crs": options.crs,
        "scene_crs": _crs_text(record.crs),
    }
    try:
        child, applied = parsers.get(entry, limits)
        message = child.request(question, wall_s=limits.wall_s, on_progress=lambda counts: counts and progress and progress(_told(counts)))
    except (SubprocessDied, LimitExceeded) as error:
        parsers.drop()
        raise _explained(source, limits, error) from error
    except BaseException:
        parsers.drop()
        raise
    if isinstance(message, Failure):
        raise _failure(source, message)
    answer: dict[str, Any] = message.value
    answer["report"]["parser"] = {**applied, "address_space_bytes": limits.address_space_bytes, "cpu_s": limits.cpu_s}
    return answer


def _told(told: Mapping[str, int]) -> str:
    return f"{told['triangles']:,} triangles" if "triangles" in told else f"{told['done']} of {told['total']} tiles"


def _adopt(
    workspace: Workspace,
    catalogue: Catalogue,
    before: SceneRecord,
    source: Source,
    draft: Path,
    report: dict[str, Any],
    proposed: SceneCrs | None,
    digest: str,
) -> Imported:
    scene, lines = before.name, read_objects(draft)
    boxes = world_boxes(draft, len(lines))
    record = _pinned(catalogue, before, proposed, boxes)
    assert record.origin is not None, "pinned above"
    _check_near(source, boxes, record.origin)
    with Registry(workspace.registry_path(scene)) as registry:
        ids = registry.put_asset(source.name, new_objects(lines, boxes, record.origin))
    write_ids(draft, ids)
    write_report(draft, report)
    final = workspace.asset_folder(scene, source.name)
    replaced = final.exists()
    content = asset_digest(draft)
    put_in_place(draft, final)
    catalogue.put_asset(AssetRecord(scene, source.name, str(source.paths[0].absolute()), source.format, content, digest, report))
    return Imported(source.name, str(source.paths[0]), source.format, len(lines), report["triangles"], replaced, report)


def _pinned(catalogue: Catalogue, before: SceneRecord, proposed: SceneCrs | None, boxes: list[Box | None]) -> SceneRecord:
    record = catalogue.pin_scene(before.name, crs=proposed or LOCAL, origin=choose_origin(boxes))
    if before.crs is None and record.crs is not None and proposed is not None and record.crs.wkt != proposed.wkt:
        raise CrsError(f"scene {before.name} was given the system {record.crs.name} meanwhile, the file was read for {proposed.name}; add it again")
    return record


def choose_origin(boxes: list[Box | None]) -> Vec3:
    """The middle of the content at its foot, in whole steps of 100 m: exact on the scene's lattice of 2^-12 m."""
    have = [box for box in boxes if box is not None]
    if not have:
        return (0.0, 0.0, 0.0)
    x, y = (_rounded((min(box[0][k] for box in have) + max(box[1][k] for box in have)) / 2) for k in (0, 1))
    return (x, y, _rounded(min(box[0][2] for box in have)))


def _rounded(value: float) -> float:
    return round(value / ORIGIN_STEP_M) * ORIGIN_STEP_M + 0.0


def _check_near(source: Source, boxes: list[Box | None], origin: Vec3) -> None:
    for box in boxes:
        if box is not None and max(abs(corner[k] - origin[k]) for corner in box for k in range(3)) > MAX_FROM_ORIGIN_M:
            raise LimitExceeded(
                f"{source.paths[0]}: content at {box[0]}, more than {MAX_FROM_ORIGIN_M:g} m from the scene's origin {origin}; is its --crs right?"
            )


def _crs_text(crs: SceneCrs | None) -> str | None:
    if crs is None:
        return None
    return "local" if crs.wkt is None else crs.wkt


def _reasons(report: Mapping[str, Any]) -> str:
    skipped = ", ".join(f"{count} × {reason}" for reason, count in sorted(report.get("skipped", {}).items()))
    return f" (skipped: {skipped})" if skipped else ""


def _explained(source: Source, limits: Limits, error: SubprocessDied | LimitExceeded) -> ImportFailed | LimitExceeded:
    if isinstance(error, LimitExceeded):
        return LimitExceeded(f"{source.paths[0]}: {error}; raise it with --parse-memory or --parse-cpu")
    if isinstance(error, SubprocessTimedOut) and limits.wall_s is not None:
        return LimitExceeded(f"{source.paths[0]}: not read within {limits.wall_s:g} s; raise it with --parse-cpu")
    return ImportFailed(f"{source.paths[0]}: the parser broke down and nothing was taken over: {error}")


def _failure(source: Source, failure: Failure) -> Map3dError:
    kinds: dict[str, type[Map3dError]] = {"CrsError": CrsError, "LimitError": LimitExceeded, "LimitExceeded": LimitExceeded}
    text = failure.message if str(source.paths[0]) in failure.message else f"{source.paths[0]}: {failure.message}"
    if failure.kind in kinds:
        return kinds[failure.kind](text)
    known = failure.kind in ("FormatError", "StorageError", "InvalidArgument") or hasattr(errors, failure.kind)
    return ImportFailed(text if known else f"{source.paths[0]}: {failure.kind}: {failure.message}")
