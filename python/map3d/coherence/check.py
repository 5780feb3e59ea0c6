"""The check of coherence: compares the assets of a scene with each other, and stores what is said of them and how they are adjusted.

`scenes/NAME/coherence.json` has the key of the last check, which depends on all assets and options, and the assets that it adjusted; what is said is
in their reports, and adjustments are beside their meshes (spec/scene.md). A check that was killed leaves another key and is repeated.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from pyproj import Transformer

from map3d import _core
from map3d.catalogue import AssetRecord, Catalogue, SceneRecord, Workspace
from map3d.catalogue.records import HEIGHTS_DIFFER
from map3d.catalogue.scene_lock import scene_lock
from map3d.coherence.datums import share_heights
from map3d.coherence.ground import Ground, find_ground, terrain_surfaces
from map3d.coherence.height_kinds import GeoidHeight
from map3d.coherence.height_rules import CLAMP, HEIGHTS, OF_FILES, HeightRules, with_choice, with_choice_of_files
from map3d.coherence.heights import HeightDecision, decide_heights, settled_ground
from map3d.coherence.same_objects import find_same_objects
from map3d.coherence.surveyed_assets import Flags, SurveyedAsset
from map3d.geometry.crs import horizontal_crs, parse_crs
from map3d.geometry.geoid import geoid_above_ellipsoid_m
from map3d.ingest.asset import left_out, local_box, world_boxes
from map3d.ingest.findings import CONTRADICTIONS, finding
from map3d.ingest.unfinished_imports import finish_imports
from map3d.registry import Registry
from map3d.types import Vec3

FILE: Final = "coherence.json"
VERSION: Final = 2
OPTIONS: Final = (HEIGHTS, CLAMP, OF_FILES)
"""Options of a scene on which a check depends."""

ADJUSTMENTS: Final = "adjustments.m3h"
DRAPED: Final = "draped.m3a"
PHOTO_TOLERANCE_M: Final = 10.0


@dataclass(frozen=True)
class CheckedScene:
    """What the last check stored: its key, and the adjusted assets."""

    key: str = ""
    adjusted: tuple[str, ...] = ()


def choose_heights(catalogue: Catalogue, scene: str, heights: str | None, clamp: Sequence[str]) -> None:
    """Sets how the next check treats the heights of files without a choice of their own.

    None and no classes leave a choice as it is, "auto" and "none" take it back. Raises BadRequest.
    """
    record = catalogue.scene(scene)
    _set_options(catalogue, record, with_choice(record.options, heights, clamp))


def choose_file_heights(catalogue: Catalogue, scene: str, assets: Sequence[str], heights: str | None, clamp: Sequence[str]) -> None:
    """As `choose_heights`, for the files of some assets, which may be imported later."""
    record = catalogue.scene(scene)
    _set_options(catalogue, record, with_choice_of_files(record.options, assets, heights, clamp))


def check_scene(workspace: Workspace, catalogue: Catalogue, scene: str) -> None:
    """Compares the assets of a scene, unless the last check still holds."""
    with scene_lock(workspace, scene):
        finish_imports(workspace, catalogue, scene)
        check_locked_scene(workspace, catalogue, scene)


def check_locked_scene(workspace: Workspace, catalogue: Catalogue, scene: str) -> None:
    """As `check_scene`; the caller holds the scene's lock and has finished killed imports."""
    record, assets = catalogue.scene(scene), catalogue.assets(scene)
    if not assets:
        (workspace.scene_folder(scene) / FILE).unlink(missing_ok=True)
        return
    folders = {asset.name: workspace.asset_folder(scene, asset.name) for asset in assets}
    if record.origin is None or not all(folder.is_dir() for folder in folders.values()) or is_checked(workspace, catalogue, record):
        return
    before = read_check(workspace, scene)
    surveyed = [SurveyedAsset(asset, folders[asset.name]) for asset in assets]
    same = find_same_objects(surveyed)
    ground = find_ground(surveyed, same.kept)
    decisions = decide_heights(surveyed, same.kept, ground, HeightRules.of(record.options), geoid_height(record, surveyed))
    ground = settled_ground(surveyed, same.kept, decisions, ground)
    adjusted = _adjust(surveyed, same.kept, decisions, ground)
    with Registry(workspace.registry_path(scene)) as registry:
        for asset in surveyed:
            if asset.name in adjusted or asset.name in before.adjusted:
                _register(registry, asset, record.origin)
    for asset in surveyed:
        said = [*same.findings.get(asset.name, ()), *_said_of_heights(asset, decisions, ground)]
        _report(catalogue, asset.record, said)
    _choose_option(catalogue, record, HEIGHTS_DIFFER, not share_heights(record, surveyed, decisions, ground))
    _store(workspace, scene, CheckedScene(check_key(record, assets), tuple(sorted(adjusted))))


def is_checked(workspace: Workspace, catalogue: Catalogue, record: SceneRecord) -> bool:
    """Whether the last check holds: nothing has changed since, and what it adjusted is still adjusted."""
    last = read_check(workspace, record.name)
    if last.key != check_key(record, catalogue.assets(record.name)):
        return False
    return all((workspace.asset_folder(record.name, name) / ADJUSTMENTS).exists() for name in last.adjusted)


def check_key(record: SceneRecord, assets: Sequence[AssetRecord]) -> str:
    """Returns a digest of everything that a check depends on."""
    crs = None if record.crs is None else record.crs.wkt
    text = json.dumps([VERSION, [(a.name, a.digest) for a in assets], crs, *(record.options.get(name) for name in OPTIONS)], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def read_check(workspace: Workspace, scene: str) -> CheckedScene:
    """Returns what the last check stored, an empty one before the first."""
    try:
        value = json.loads((workspace.scene_folder(scene) / FILE).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return CheckedScene()
    return CheckedScene(value["key"], tuple(value["adjusted"]))


def _set_options(catalogue: Catalogue, record: SceneRecord, options: Mapping[str, Any]) -> None:
    if options != dict(record.options):
        catalogue.set_scene_options(record.name, options)


def _choose_option(catalogue: Catalogue, record: SceneRecord, name: str, value: Any) -> None:
    """Sets an option of a scene, or removes it if the value is empty."""
    others = {key: other for key, other in record.options.items() if key != name}
    _set_options(catalogue, record, {**others, name: value} if value else others)


def geoid_height(record: SceneRecord, assets: Sequence[SurveyedAsset]) -> GeoidHeight:
    """Returns what computes the height of the geoid in the middle of the scene, which is unknown in local metres, when it is needed first."""
    return cache(partial(_geoid_m, record, assets))


def _geoid_m(record: SceneRecord, assets: Sequence[SurveyedAsset]) -> float | None:
    boxes = [asset.boxes[asset.drawn] for asset in assets if not asset.has_heights and asset.drawn.any()]
    if record.crs is None or record.crs.wkt is None or not boxes:
        return None
    x, y = np.median(np.concatenate(boxes)[:, 0, :2], axis=0)
    lon, lat = Transformer.from_crs(horizontal_crs(parse_crs(record.crs.wkt)), "EPSG:4326", always_xy=True).transform(x, y)
    return geoid_above_ellipsoid_m(lon, lat) if abs(lon) <= 360.0 and abs(lat) < 90.0 else None


def _adjust(assets: Sequence[SurveyedAsset], kept: Mapping[str, Flags], decisions: Mapping[str, HeightDecision], ground: Ground) -> set[str]:
    """Writes the adjustments of assets, and removes those that no longer hold; returns the names of the adjusted assets."""
    adjusted = set()
    for asset in assets:
        for name in (ADJUSTMENTS, DRAPED):
            (asset.folder / name).unlink(missing_ok=True)
        decision = decisions.get(asset.name)
        if decision is None or (decision.is_plain and kept[asset.name].all()):
            continue
        left = ~kept[asset.name] | np.isfinite(decision.draped)
        _core.write_adjustments(str(asset.folder), decision.scale, asset.spread(np.where(left, np.nan, decision.shifts)))
        adjusted.add(asset.name)
    draped = [asset for asset in assets if asset.name in adjusted and np.isfinite(decisions[asset.name].draped).any()]
    if draped:
        surfaces = [*terrain_surfaces(assets, kept, is_adjusted=True), *_photos(assets)]
        fallback = None if ground.grid is None else _core.Surface.of_mesh(*ground.grid.mesh())
        for asset in draped:
            decision = decisions[asset.name]
            bases = asset.spread(np.where(kept[asset.name], decision.draped, np.nan))
            _core.drape_objects(str(asset.folder), bases, decision.scale, surfaces, fallback)
    return adjusted


def _photos(assets: Sequence[SurveyedAsset]) -> list[_core.Surface]:
    """Returns the surfaces of photos without elevation model."""
    flat = (asset for asset in assets if asset.is_raster and not asset.has_heights)
    return [_core.Surface.of_asset(str(asset.folder), np.ones(asset.count, dtype=bool), False) for asset in flat]


def _said_of_heights(asset: SurveyedAsset, decisions: Mapping[str, HeightDecision], ground: Ground) -> list[dict[str, Any]]:
    if asset.name in decisions:
        return decisions[asset.name].findings
    if asset.has_heights or ground.grid is None or not asset.drawn.any():
        return []
    boxes = asset.boxes[asset.drawn]
    centre = (boxes[:, 0, :2] + boxes[:, 1, :2]) / 2
    away = float(np.median(ground.grid.at(centre[:, 0], centre[:, 1]) - (boxes[:, 0, 2] + boxes[:, 1, 2]) / 2))
    return [finding("photo-below-objects", 1, asset.source, distance=abs(round(away, 1)))] if abs(away) > PHOTO_TOLERANCE_M else []


def _register(registry: Registry, asset: SurveyedAsset, origin: Vec3) -> None:
    """Registers the boxes of objects as they are drawn; those that are left out are not present."""
    ids = np.fromfile(asset.folder / "ids.u32", "<u4").tolist()
    boxes = world_boxes(asset.folder, len(ids))
    local = dict(zip(ids, (local_box(box, origin) for box in boxes), strict=True))
    registry.set_boxes(asset.name, local, {ids[number] for number in left_out(asset.folder, len(ids)).tolist()})


def _report(catalogue: Catalogue, record: AssetRecord, said: Sequence[Mapping[str, Any]]) -> None:
    """Stores what is said of an asset in its report."""
    if list(record.report.get(CONTRADICTIONS, ())) == list(said):
        return
    report = {name: value for name, value in record.report.items() if name != CONTRADICTIONS}
    catalogue.put_asset(replace(record, report={**report, CONTRADICTIONS: list(said)} if said else report))


def _store(workspace: Workspace, scene: str, checked: CheckedScene) -> None:
    path: Path = workspace.scene_folder(scene) / FILE
    value = {"version": VERSION, "key": checked.key, "adjusted": list(checked.adjusted)}
    draft = path.with_name(f"{FILE}.new")
    draft.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")
    draft.replace(path)
