"""Where the content of assets is: clusters far from each other, and the extent of those that a scene keeps (spec/scene.md, Extent)."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from map3d import _core
from map3d.catalogue import Catalogue, Workspace
from map3d.types import Box, Vec3

KEEP_OUTLIERS: Final = "keep_outliers"
CLUSTER: Final = "cluster"


@dataclass(frozen=True)
class Cluster:
    """`number` counts from 1, the largest cluster first. `box`: world coordinates."""

    number: int
    box: Box
    triangles: int
    objects: int


@dataclass(frozen=True)
class ContentExtent:
    """`text`: JSON of `_core.find_clusters`."""

    text: str

    @property
    def boxes(self) -> list[Box]:
        return [_box(region["bounds"]["lo"], region["bounds"]["hi"]) for region in json.loads(self.text)["regions"]]

    def keeps_point(self, point: Vec3) -> bool:
        """Whether something small at this place stays."""
        value = json.loads(self.text)
        if value["all_around"] is not None:
            return all(abs(a - b) <= _core.MAX_FROM_ORIGIN_M for a, b in zip(point, value["all_around"], strict=True))
        return any(all(low <= x <= high for low, x, high in zip(box[0], point, box[1], strict=True)) for box in self.boxes)


@dataclass(frozen=True)
class Content:
    """`extent`: None when everything stays; `outside`: numbers of the folders with content outside it."""

    clusters: tuple[Cluster, ...]
    extent: ContentExtent | None
    outside: tuple[int, ...]


def find_content(folders: Sequence[Path], origin: Vec3, options: Mapping[str, Any]) -> Content:
    """Measures the assets that no one has measured yet. `options`: build options, of which only those of the extent count.

    Raises `_core.InvalidArgument` for a cluster that does not exist.
    """
    chosen = {name: options[name] for name in (KEEP_OUTLIERS, CLUSTER) if options.get(name)}
    found = json.loads(_core.find_clusters([str(folder) for folder in folders], origin, json.dumps(chosen)))
    clusters = tuple(Cluster(number, _box(*row["box"]), row["triangles"], row["objects"]) for number, row in enumerate(found["clusters"], 1))
    extent = None if found["extent"] is None else ContentExtent(json.dumps(found["extent"]))
    return Content(clusters, extent, tuple(found["outside"]))


def content_centre(workspace: Workspace, catalogue: Catalogue, scene: str) -> Vec3 | None:
    """Returns the centre of the group of content that a build of the scene keeps, in world coordinates: the chosen one, else the largest; None if the
    scene is empty."""
    record = catalogue.scene(scene)
    if record.origin is None:
        return None
    folders = [workspace.asset_folder(scene, asset.name) for asset in catalogue.assets(scene)]
    clusters = find_content(folders, record.origin, {}).clusters
    if not clusters:
        return None
    number = record.options.get(CLUSTER) or 1
    low, high = clusters[number - 1 if number <= len(clusters) else 0].box
    return ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2)


def _box(low: Sequence[float], high: Sequence[float]) -> Box:
    return ((low[0], low[1], low[2]), (high[0], high[1], high[2]))
