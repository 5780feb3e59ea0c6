"""`map3d verify`: recomputes everything that can be recomputed, for scenes and renderings."""

from collections.abc import Callable, Mapping
from itertools import groupby
from operator import attrgetter

import numpy as np

from map3d import _core
from map3d.catalogue import Catalogue, Job, PlannedJob, RenderingRecord, State, Workspace
from map3d.errors import Map3dError
from map3d.ingest.asset import asset_digest
from map3d.ingest.asset_removal import is_removing
from map3d.ingest.unfinished_imports import unfinished_imports
from map3d.lifecycle.remove_rendering import is_rendering_removed
from map3d.registry import Registry
from map3d.renderings.manifest_writer import current_manifest
from map3d.renderings.plan import PlannedBlocks, plan_jobs
from map3d.scenes.build import is_stale, open_scene
from map3d.scenes.scene_cache import has_assets, scene_in_use
from map3d.scenes.scene_files import binary_files, check_file, check_ids, check_index
from map3d.scenes.shared_scene import FILES
from map3d.tiles.manifest import Manifest
from map3d.tiles.naming import block_of
from map3d.tiles.track_stores import read_manifest
from map3d.types import TileId
from map3d.verify.findings import Findings
from map3d.verify.track_checks import check_track

Progress = Callable[[str, int, int], None]
"""(stage, done, total)."""


def verify_scene(workspace: Workspace, catalogue: Catalogue, scene: str, findings: Findings, progress: Progress) -> None:
    """Checks the checksums of all files, the scene index, the assets against the catalogue, and the ids against the registry."""
    folder = workspace.scene_folder(scene)
    for name in unfinished_imports(folder / "assets"):
        findings.add(f"{folder / 'assets' / name}: its import has not finished; run map3d render, or add its file again with map3d add-files {scene}")
    if is_removing(workspace, scene):
        findings.add(f"scene {scene}: the removal of files has not finished; run map3d remove-files again, or map3d render")
    if not catalogue.assets(scene) or (FILES in catalogue.scene(scene).options and not has_assets(folder)):
        return
    files = list(binary_files(folder))
    for done, path in enumerate(files, 1):
        problem = check_file(path)
        if problem:
            findings.add(problem)
        progress(f"files of {scene}", done, len(files))
    findings.count("scene files", len(files))
    if (folder / "scene.json").is_file():
        for line in check_index(folder):
            findings.add(line)
    with Registry(workspace.registry_path(scene)) as registry:
        for asset in catalogue.assets(scene):
            if asset_digest(folder / "assets" / asset.name) != asset.digest:
                findings.add(f"{folder / 'assets' / asset.name}: differs from the catalogue; run map3d add-files {scene} {asset.source}")
            for line in check_ids(folder, asset.name, registry):
                findings.add(line)
        findings.count("objects", registry.count())


def verify_rendering(workspace: Workspace, catalogue: Catalogue, name: str, findings: Findings, progress: Progress) -> None:
    """Checks jobs against the plan, stored blocks against jobs, every tile, seam and parent, and the manifest."""
    record = catalogue.rendering(name)
    if is_rendering_removed(workspace, name):
        findings.add(f"rendering {name}: its removal has not finished; run map3d remove-rendering {name} again")
    if is_stale(workspace, catalogue, record.scene):
        findings.add(f"scene {record.scene}: its files have changed since the last build; run map3d render {name}")
        return
    with scene_in_use(workspace, catalogue.scene(record.scene)):
        _verify_tiles(workspace, catalogue, record, findings, progress)


def _verify_tiles(workspace: Workspace, catalogue: Catalogue, record: RenderingRecord, findings: Findings, progress: Progress) -> None:
    scene = open_scene(workspace, record.scene)
    _check_plan(catalogue, record, scene, findings)
    with Registry(workspace.registry_path(record.scene)) as registry:
        ids = np.array([item.id for item in registry.objects()], dtype=np.uint32)
    for frame in record.frames:
        found = {track.id: check_track(workspace, catalogue, record, track, scene, ids, findings, progress) for track in record.tracks_of(frame)}
        if _is_complete(catalogue, record):
            _check_passes(record, found, findings)
    _check_manifest(workspace, catalogue, record, scene, findings)


def _check_plan(catalogue: Catalogue, record: RenderingRecord, scene: _core.Scene, findings: Findings) -> None:
    """Checks that every block with content has a job that is done with the current key. Memory holds the jobs of one track."""
    tracks = set()
    for track, blocks in groupby(plan_jobs(scene, record, PlannedBlocks(catalogue, record)), attrgetter("track")):
        tracks.add(track)
        jobs = {job.block: job for job in catalogue.jobs(record.name, track)}
        for expected in blocks:
            findings.count("blocks")
            if fault := _fault_of(expected, jobs.pop(expected.block, None)):
                findings.add(f"{record.name} {track} block {expected.block}: {fault}")
        for block in jobs:
            findings.add(f"{record.name} {track} block {block}: a job outside the plan")
    for job in catalogue.jobs(record.name):
        if job.track not in tracks:
            findings.add(f"{record.name} {job.track} block {job.block}: a job outside the plan")


def _fault_of(expected: PlannedJob, found: Job | None) -> str | None:
    if found is None:
        return "has content but no job"
    if found.key != expected.key:
        return f"rendered from an older scene; run map3d render {found.rendering}"
    if found.state is not State.DONE:
        return f"{found.state} instead of done{f' ({found.reason})' if found.reason else ''}"
    return None


def _check_passes(record: RenderingRecord, found: Mapping[str, set[TileId] | None], findings: Findings) -> None:
    """Checks that every rendered pass of a view has the same tiles. `found`: the tiles by track, starting with the first pass."""
    (first, tiles), *later = found.items()
    for track, others in later:
        for tile in sorted(tiles ^ others) if tiles is not None and others is not None else ():
            block = block_of(tile, record.zmax)
            findings.add(f"{record.name} tile {tile.z}/{tile.x}/{tile.y}: exists in only one of the tracks {first} and {track}", track, block)


def _is_complete(catalogue: Catalogue, record: RenderingRecord) -> bool:
    counts = catalogue.count_jobs(record.name)
    return counts[State.DONE] == sum(counts.values())


def _check_manifest(workspace: Workspace, catalogue: Catalogue, record: RenderingRecord, scene: _core.Scene, findings: Findings) -> None:
    path = workspace.manifest_path(record.name)
    if not _is_complete(catalogue, record):
        return
    try:
        data = read_manifest(workspace, record)
        if data is None:
            findings.add(f"{path}: missing; run map3d render {record.name}")
            return
        found = Manifest.load(data, str(path)).to_json()
    except (OSError, Map3dError) as error:
        findings.add(f"{path}: cannot read the manifest: {error}")
        return
    expected = current_manifest(workspace, catalogue, record, scene.box, {}).to_json()
    for key in sorted(set(found) | set(expected)):
        if found.get(key) != expected.get(key):
            findings.add(f"{path}: {key} differs from the catalogue and the tile stores; run map3d render {record.name}")
    findings.count("manifests")
