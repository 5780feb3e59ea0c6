"""Content far from the rest: found before a build, left out unless the scene keeps it, and listed."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from map3d import _core
from map3d.catalogue import AssetRecord, Catalogue, SceneRecord, Workspace
from map3d.errors import BadRequest
from map3d.ingest.asset import boxes_within, left_out, local_box, read_objects
from map3d.ingest.content import CLUSTER, KEEP_OUTLIERS, Cluster, Content, ContentExtent, find_content
from map3d.registry import Registry
from map3d.types import Box

FILE: Final = "outliers.json"
EXAMPLES: Final = 5


@dataclass(frozen=True)
class OutlierObject:
    """`triangles`: those left out; `whole`: the object has no others; `distance_m`: from what the scene keeps to the farthest of them."""

    name: str
    triangles: int
    whole: bool
    distance_m: float


@dataclass(frozen=True)
class FileOutliers:
    """What was left out of one file. `examples`: the farthest objects, some of `objects`."""

    asset: str
    source: str
    objects: int
    whole: int
    triangles: int
    examples: tuple[OutlierObject, ...]

    @property
    def distance_m(self) -> float:
        return self.examples[0].distance_m


@dataclass(frozen=True)
class Outliers:
    """`clusters`: groups of content far from each other, largest first; `kept`: numbers of those in the scene; `files`: what was left out."""

    clusters: tuple[Cluster, ...] = ()
    kept: tuple[int, ...] = ()
    files: tuple[FileOutliers, ...] = ()

    @property
    def triangles(self) -> int:
        return sum(file.triangles for file in self.files)

    @property
    def farthest_first(self) -> list[FileOutliers]:
        return sorted(self.files, key=lambda file: (-file.distance_m, file.source))


@dataclass
class OutlierCheck:
    """The clusters of a scene before its build, and the registry and the list of outliers after it."""

    workspace: Workspace
    scene: SceneRecord
    assets: Sequence[AssetRecord]
    options: Mapping[str, Any]
    content: Content = field(init=False)

    def __post_init__(self) -> None:
        assert self.scene.origin is not None, "a scene with files has an origin"
        folders = [self.workspace.asset_folder(self.scene.name, asset.name) for asset in self.assets]
        try:
            self.content = find_content(folders, self.scene.origin, self.options)
        except _core.InvalidArgument as error:
            raise BadRequest(f"scene {self.scene.name}: {error}; --cluster counts from 1, largest first") from error

    def finish(self, registry: Registry) -> Outliers:
        """Brings the registry in line with what was built, and stores and returns the list of outliers."""
        path = self.workspace.scene_folder(self.scene.name) / FILE
        if self.content.extent is None:
            if path.exists():
                self._register(registry, None)
                path.unlink()
            return Outliers()
        found = Outliers(self.content.clusters, self._kept(self.content.extent), self._register(registry, self.content.extent))
        path.write_text(json.dumps(asdict(found), ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
        return found

    def _kept(self, extent: ContentExtent) -> tuple[int, ...]:
        return tuple(cluster.number for cluster in self.content.clusters if cluster.box in extent.boxes)

    def _register(self, registry: Registry, extent: ContentExtent | None) -> tuple[FileOutliers, ...]:
        """Registers the boxes of what is in the extent; returns what is not."""
        found = (self._register_asset(registry, asset, extent) for asset in self.assets)
        return tuple(file for file in found if file is not None)

    def _register_asset(self, registry: Registry, asset: AssetRecord, extent: ContentExtent | None) -> FileOutliers | None:
        folder = self.workspace.asset_folder(self.scene.name, asset.name)
        ids = np.frombuffer((folder / "ids.u32").read_bytes(), dtype="<u4").tolist()
        all_boxes, _ = boxes_within(folder, len(ids), None)
        boxes, outside = boxes_within(folder, len(ids), extent)
        absent = {number for number, whole, kept in zip(ids, all_boxes, boxes, strict=True) if whole is not None and kept is None}
        absent |= {ids[number] for number in left_out(folder, len(ids)).tolist()}
        assert self.scene.origin is not None, "a scene with files has an origin"
        local = {number: local_box(box, self.scene.origin) for number, box in zip(ids, boxes, strict=True)}
        registry.set_boxes(asset.name, local, absent)
        left = [k for k, count in enumerate(outside) if count]
        if not left or extent is None:
            return None
        names = read_objects(folder)
        objects = [OutlierObject(names[k]["name"], outside[k], boxes[k] is None, _distance_m(all_boxes[k], extent.boxes)) for k in left]
        objects.sort(key=lambda item: (-item.distance_m, item.name))
        whole = sum(item.whole for item in objects)
        return FileOutliers(asset.name, Path(asset.source).name, len(left), whole, sum(outside), tuple(objects[:EXAMPLES]))


def read_outliers(workspace: Workspace, scene: str) -> Outliers:
    """Returns what the last build of the scene left out, and its clusters; empty when everything is in one place."""
    try:
        text = (workspace.scene_folder(scene) / FILE).read_text(encoding="utf-8")
    except FileNotFoundError:
        return Outliers()
    return parse_outliers(json.loads(text))


def parse_outliers(value: Mapping[str, Any]) -> Outliers:
    """Returns outliers from their JSON form."""
    clusters = tuple(Cluster(row["number"], _as_box(row["box"]), row["triangles"], row["objects"]) for row in value["clusters"])
    files = tuple(FileOutliers(**{**row, "examples": tuple(OutlierObject(**one) for one in row["examples"])}) for row in value["files"])
    return Outliers(clusters, tuple(value["kept"]), files)


def choose_content(catalogue: Catalogue, scene: str, keep_outliers: bool | None, cluster: int | None) -> None:
    """Sets what the next build of a scene keeps; None leaves the choice as it is, 0 is the largest cluster."""
    record = catalogue.scene(scene)
    options = dict(record.options)
    for name, value in ((KEEP_OUTLIERS, keep_outliers), (CLUSTER, cluster)):
        if value:
            options[name] = value
        elif value is not None:
            options.pop(name, None)
    if options != dict(record.options):
        catalogue.set_scene_options(scene, options)


def _distance_m(box: Box | None, kept: Sequence[Box]) -> float:
    """Returns the horizontal distance, or the vertical one if it is greater, of the farthest content of a box from the nearest kept box."""
    if box is None:
        return 0.0
    return round(min(max(max(other[0][k] - box[0][k], box[1][k] - other[1][k], 0.0) for k in range(3)) for other in kept), 1)


def _as_box(value: Any) -> Box:
    low, high = value
    return ((low[0], low[1], low[2]), (high[0], high[1], high[2]))
