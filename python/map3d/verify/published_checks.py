"""Verifies a published folder: its consistency, and optionally its tiles against the workspace that it was published from."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from map3d.catalogue import Workspace
from map3d.errors import Corrupt, NotFound, VerifyFailed
from map3d.geometry.views import track_id
from map3d.publish.checksums import CHECKSUMS, file_digest, parse_checksums
from map3d.publish.pmtiles_archive import Archive
from map3d.registry.documents import ATTRIBUTES, SEARCH
from map3d.tiles.manifest import FILE_NAME, Manifest, ManifestView
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.tile_store import TileStore
from map3d.tiles.track_stores import open_track, rendering_record
from map3d.tiles.viewer_files import PAGE
from map3d.types import Layer, TileId

FIRST_BYTES: Final = {"png": b"\x89PNG\r\n\x1a\n", "jpeg": b"\xff\xd8\xff", "webp": b"RIFF", "m3d": b"M3D\x01"}
SHOWN: Final = 10


@dataclass(frozen=True)
class VerifiedCounts:
    """The number of verified files, archives and tiles."""

    files: int
    archives: int
    tiles: int


def verify_published(folder: Path, workspace: Workspace | None = None) -> VerifiedCounts:
    """Verifies the folder, and compares every tile with the store when `workspace` is given. Raises NotFound, Corrupt for an invalid manifest,
    VerifyFailed with the problems found."""
    try:
        manifest = Manifest.load((folder / FILE_NAME).read_bytes(), str(folder / FILE_NAME))
    except FileNotFoundError as error:
        raise NotFound(f"{folder}: not a published rendering") from error
    problems = [f"{name} is missing" for name in (PAGE, SEARCH, ATTRIBUTES, CHECKSUMS) if not (folder / name).is_file()]
    files, added_problems = _check_sums(folder)
    problems += added_problems
    archives = tiles = 0
    record = None if workspace is None else rendering_record(workspace, manifest.name)
    for view in manifest.views:
        for number, layers in enumerate(manifest.passes):
            with ExitStack() as opened:
                store = None
                if workspace is not None and record is not None:
                    store = opened.enter_context(open_track(workspace, record, track_id(view.frame.id, number)))
                for layer in layers:
                    found, added_problems = _check_layer(folder, view, layer, store, manifest.archive_part_bytes)
                    archives, tiles, problems = archives + (found > 0), tiles + found, problems + added_problems
    if problems:
        more = f", and {len(problems) - SHOWN} more" if len(problems) > SHOWN else ""
        raise VerifyFailed(f"{folder}: {'; '.join(problems[:SHOWN])}{more}; publish it again")
    return VerifiedCounts(files, archives, tiles)


def _check_sums(folder: Path) -> tuple[int, list[str]]:
    path = folder / CHECKSUMS
    digests = parse_checksums(path.read_bytes() if path.is_file() else None)
    problems = []
    for name, digest in digests.items():
        file = folder / name
        if not file.is_file():
            problems.append(f"{name} is missing")
        elif file_digest(file) != digest:
            problems.append(f"{name} has changed since it was published")
    return len(digests) - len(problems), problems


def _check_layer(folder: Path, view: ManifestView, layer: Layer, store: TileStore | None, part_bytes: int) -> tuple[int, list[str]]:
    """Returns the number of tiles and the problems. `store`: the tile store to compare with; `part_bytes`: size of the parts of archives, or 0."""
    name = (view.archives or {}).get(layer.name)
    if name is None:
        count = view.occupancy.count()
        return 0, [f"view {view.frame.id}: no archive for {count} tiles of layer {layer.name}"] if count else []
    try:
        archive = Archive(folder / name, part_bytes)
        problems = [] if archive.has_format_of(layer) else [f"{name}: its tiles are not {layer.format}"]
        seen: set[TileId] = set()
        problems += _check_tiles(archive, name, layer, store, seen)
    except Corrupt as error:
        return 0, [str(error)]
    return len(seen), problems + _check_occupancy(name, view.occupancy, seen)


def _check_tiles(archive: Archive, name: str, layer: Layer, store: TileStore | None, seen: set[TileId]) -> Iterator[str]:
    number = 0 if store is None else store.shape.layer_number(layer.name)
    for tile, data in archive.tiles():
        seen.add(tile)
        if not data.startswith(FIRST_BYTES[layer.format]):
            yield f"{name}: tile {tile.z}/{tile.x}/{tile.y} is not {layer.format}"
        if store is not None and store.get_tile(number, *tile) != data:
            yield f"{name}: tile {tile.z}/{tile.x}/{tile.y} differs from the store"


def _check_occupancy(name: str, occupancy: Occupancy, seen: set[TileId]) -> list[str]:
    expected = {tile for z in range(occupancy.zmax + 1) for tile in occupancy.tiles(z)}
    missing, added = expected - seen, seen - expected
    return ([f"{name}: {len(missing)} tiles are missing"] if missing else []) + (
        [f"{name}: {len(added)} tiles are not in the manifest"] if added else []
    )
