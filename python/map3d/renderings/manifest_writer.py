"""Writes `rendering.json` from the catalogue and the scene (spec/manifest.md)."""

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from map3d.catalogue import Catalogue, JobResult, RenderingRecord, SceneRecord, State, Track, Workspace
from map3d.catalogue.records import LOCAL_CRS_NAME
from map3d.errors import BadRequest
from map3d.geometry.frames import PinnedFrame
from map3d.registry import Registry
from map3d.renderings.lon_lat import geographic_of
from map3d.renderings.opening_view import read_objects_box, read_opening
from map3d.renderings.thumbnail import make_thumbnail
from map3d.tiles.block_versions import BlockVersions
from map3d.tiles.manifest import Manifest, ManifestCrs, ManifestView, Thumbnail
from map3d.tiles.naming import block_levels
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.tile_store import TileStore
from map3d.tiles.track_stores import find_track, read_manifest, share_manifest
from map3d.types import BlockId, Box, Vec3

Planned = Mapping[str, Occupancy]
"""View → tiles of level zmax that open base blocks of its first pass may still fill."""


def write_manifest(workspace: Workspace, catalogue: Catalogue, rendering: str, box: Box, planned: Planned | None = None) -> Manifest:
    """Writes the manifest of the stored tiles and of the `planned` ones. Announces the content version before the file becomes visible. `box`: the
    local box of the scene's content."""
    record = catalogue.rendering(rendering)
    manifest = current_manifest(workspace, catalogue, record, box, planned or {})
    catalogue.announce(rendering, record.content_version)
    _write(workspace.manifest_path(rendering), manifest.dump())
    share_manifest(record, manifest.dump())
    return manifest


def current_manifest(workspace: Workspace, catalogue: Catalogue, record: RenderingRecord, box: Box, planned: Planned) -> Manifest:
    scene = catalogue.scene(record.scene)
    counts = catalogue.count_jobs(record.name)
    window = _start(record, box)
    with Registry(workspace.registry_path(record.scene)) as registry:
        objects, opening, objects_box = registry.count(), read_opening(registry, box, window), read_objects_box(registry, box)
    return Manifest(
        name=record.name,
        title=record.title or scene.title,
        attribution=record.attribution or scene.attribution,
        content_version=record.content_version,
        complete=counts[State.DONE] == sum(counts.values()) > 0 and not record.planning,
        crs=_crs(scene),
        origin=_origin(scene),
        box=box,
        passes=record.passes,
        views=tuple(_view(workspace, catalogue, record, frame, planned.get(frame.id)) for frame in record.frames),
        objects=objects,
        objects_box=objects_box,
        start=window if opening is None else opening.position,
        start_radius_m=None if opening is None else opening.radius_m,
        geographic=geographic_of(scene, box),
        description=record.description,
        start_view=record.start_view,
    )


def describe_manifest(workspace: Workspace, catalogue: Catalogue, record: RenderingRecord) -> None:
    """Writes the texts and the start view of a rendering to its manifest, if it has one. Its tiles and versions stay."""
    data = read_manifest(workspace, record)
    if data is None:
        return
    scene, where = catalogue.scene(record.scene), workspace.manifest_path(record.name)
    manifest = replace(
        Manifest.load(data, str(where)),
        title=record.title or scene.title,
        attribution=record.attribution or scene.attribution,
        description=record.description,
        start_view=record.start_view,
    )
    _write(where, manifest.dump())
    share_manifest(record, manifest.dump())


def _start(record: RenderingRecord, box: Box) -> Vec3 | None:
    """Returns the centre of the rendering's window, where its map opens; or None."""
    window = record.window
    return None if window is None else (window.x_m, window.y_m, (box[0][2] + box[1][2]) / 2)


def stored_occupancy(store: TileStore) -> Occupancy:
    """Returns the tiles of level zmax in the store; every layer has the same."""
    return Occupancy.from_tiles(store.shape.zmax, store.list_tile_positions(store.shape.zmax))


def _view(workspace: Workspace, catalogue: Catalogue, record: RenderingRecord, frame: PinnedFrame, planned: Occupancy | None) -> ManifestView:
    """Takes occupancy and versions from the results of the jobs; the occupancy from the first pass, since every pass has the same tiles."""
    tracks = record.tracks_of(frame)
    occupancy = _occupancy(workspace, catalogue, record, tracks[0])
    versions = tuple(BlockVersions.of((block, result.version) for block, result in _results(catalogue, record, track)) for track in tracks)
    return ManifestView(frame, occupancy if planned is None else occupancy | planned, versions, thumbnail=_thumbnail(workspace, record, tracks[0]))


def _thumbnail(workspace: Workspace, record: RenderingRecord, track: Track) -> Thumbnail | None:
    found = find_track(workspace, record, track.id)
    if found is None:
        return None
    with found as store:
        return make_thumbnail(store)


def _results(catalogue: Catalogue, record: RenderingRecord, track: Track) -> Iterator[tuple[BlockId, JobResult]]:
    """Yields the results of all jobs of a track that were done once."""
    return ((job.block, job.result) for job in catalogue.jobs(record.name, track.id) if job.result is not None)


def _occupancy(workspace: Workspace, catalogue: Catalogue, record: RenderingRecord, track: Track) -> Occupancy:
    """Jobs of earlier versions of map3d have no occupancy in their results; the store has it."""
    try:
        return Occupancy.from_blocks(track.frame.zmax, _base_bits(_results(catalogue, record, track), block_levels(track.frame.zmax)[0].root))
    except _UnknownBits:
        found = find_track(workspace, record, track.id)
    if found is None:
        return Occupancy.from_blocks(track.frame.zmax, ())
    with found as store:
        return stored_occupancy(store)


class _UnknownBits(Exception):
    """A block's result has no occupancy."""


def _base_bits(results: Iterable[tuple[BlockId, JobResult]], root: int) -> Iterator[tuple[int, int, int]]:
    """Yields (column, row, bits) of base blocks. Raises _UnknownBits."""
    for block, result in results:
        if block.z == root and not result.empty:
            if result.occupied is None:
                raise _UnknownBits
            yield block.x, block.y, result.occupied


def _crs(scene: SceneRecord) -> ManifestCrs:
    crs = scene.stated_crs
    return ManifestCrs(LOCAL_CRS_NAME) if crs is None else ManifestCrs(crs.name, crs.epsg, crs.wkt, crs.vertical, crs.heights, crs.vertical_epsg)


def _origin(record: SceneRecord) -> Vec3:
    """Raises BadRequest while the scene has no files."""
    if record.origin is None:
        raise BadRequest(f"scene {record.name} has no files yet; add some with map3d add-files {record.name} FILE…")
    return record.origin


def _write(path: Path, data: bytes) -> None:
    """Writes atomically and durably."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{os.getpid()}.new")
    with draft.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
