"""Builds a large town from translated copies of one district; each copy has its own assets and images.

The images of copies differ by a JPEG comment, so map3d treats them as different textures and prepares, stores, reads and decodes each.
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xxhash

from map3d.catalogue import AssetRecord, Catalogue, Workspace
from map3d.ingest.asset import asset_digest, new_objects, read_objects, world_boxes, write_ids
from map3d.registry import Registry

HEADER_BYTES = 64


@dataclass(frozen=True)
class DistrictCopier:
    """Copies the assets of one scene of a workspace to another, `pitch_m` apart."""

    workspace: Workspace
    source: str
    scene: str
    pitch_m: float

    def add_copy(self, catalogue: Catalogue, number: int) -> None:
        """Adds copy number 0, 1, …; the first n copies fill a square as far as possible."""
        column, row = copy_position(number)
        self.add_copy_at(catalogue, number, np.array([column * self.pitch_m, row * self.pitch_m, 0.0]))

    def add_copy_at(self, catalogue: Catalogue, number: int, offset: "np.ndarray[Any, np.dtype[np.float64]]") -> None:
        """Adds a copy translated by `offset` in metres; `number` gives its name."""
        template = catalogue.scene(self.source)
        origin = catalogue.pin_scene(self.scene, crs=template.crs, origin=template.origin).origin
        assert origin is not None, "the source has assets"
        self.workspace.scene_folder(self.scene).mkdir(parents=True, exist_ok=True)
        with Registry(self.workspace.registry_path(self.scene)) as registry:
            for asset in catalogue.assets(self.source):
                name = f"d{number:04d}-{asset.name}"
                folder = self.workspace.asset_folder(self.scene, name)
                copy_asset(self.workspace.asset_folder(self.source, asset.name), folder, f"copy {number}", offset)
                lines = read_objects(folder)
                write_ids(folder, registry.put_asset(name, new_objects(lines, world_boxes(folder, len(lines)), origin)))
                record = AssetRecord(
                    self.scene, name, asset.source, asset.format, asset_digest(folder), f"{asset.source_digest}-{number}", asset.report
                )
                catalogue.put_asset(record)


def copy_position(number: int) -> tuple[int, int]:
    """Returns column and row of a copy: the first 1, 4, 9, … copies are squares."""
    side = int(np.sqrt(number))
    rest = number - side * side
    return (side, rest) if rest <= side else (rest - side - 1, side)


def copy_asset(source: Path, folder: Path, comment: str, offset: "np.ndarray[Any, np.dtype[np.float64]]") -> None:
    """Copies an asset folder, without ids, translated by `offset` in metres."""
    (folder / "textures").mkdir(parents=True)
    keys = {path.stem: _copy_image(path, folder / "textures", comment) for path in sorted((source / "textures").iterdir())}
    tables = json.loads((source / "materials.json").read_text(encoding="utf-8"))
    for material in tables["materials"]:
        material["texture"] = keys.get(material["texture"])
        if material["alpha"] is not None:
            raise SystemExit(f"bench: {source}: has textures with alpha; generate the town without trees")
    (folder / "materials.json").write_text(json.dumps(tables), encoding="utf-8")
    (folder / "objects.jsonl").write_bytes((source / "objects.jsonl").read_bytes())
    data = np.fromfile(source / "mesh.m3a", np.uint8)
    vertices = int(data[16:24].view("<u8")[0])
    data[HEADER_BYTES : HEADER_BYTES + 24 * vertices].view("<f8").reshape(-1, 3)[:] += offset
    data[8:16].view("<u8")[0] = xxhash.xxh3_64_intdigest(data[HEADER_BYTES:].data)
    data.tofile(folder / "mesh.m3a")


def _copy_image(path: Path, folder: Path, comment: str) -> str:
    """Copies a JPEG with an additional comment; returns its key."""
    data = path.read_bytes()
    if data[:2] != b"\xff\xd8":
        raise SystemExit(f"bench: {path}: not a JPEG")
    text = comment.encode()
    data = data[:2] + b"\xff\xfe" + (len(text) + 2).to_bytes(2, "big") + text + data[2:]
    key = hashlib.sha256(data).hexdigest()[:32]
    (folder / f"{key}{path.suffix}").write_bytes(data)
    return key
