"""The ground of a photo without elevation model: relief in the documents of the scene, else interpolated between the bases of their objects."""

import numpy as np

from map3d import _core
from map3d.catalogue import AssetRecord, Catalogue, Workspace
from map3d.coherence.check import geoid_height
from map3d.coherence.ground import find_ground
from map3d.coherence.height_rules import HeightRules
from map3d.coherence.heights import decide_heights, settled_ground, standing_bases
from map3d.coherence.same_objects import find_same_objects
from map3d.coherence.surveyed_assets import SurveyedAsset
from map3d.ingest.ground_grid import MAX_CELLS, GroundGrid


def photo_ground(workspace: Workspace, catalogue: Catalogue, scene: str) -> GroundGrid | None:
    """Returns the ground between the objects of the documents of a scene, as they are drawn; None if nothing stands on it."""
    record = catalogue.scene(scene)
    assets = [SurveyedAsset(asset, workspace.asset_folder(scene, asset.name)) for asset in catalogue.assets(scene) if "rasters" not in asset.report]
    kept = find_same_objects(assets).kept
    ground = find_ground(assets, kept)
    decisions = decide_heights(assets, kept, ground, HeightRules.of(record.options), geoid_height(record, assets))
    ground = settled_ground(assets, kept, decisions, ground)
    boxes = np.concatenate([asset.boxes[asset.drawn & asset.is_terrain] for asset in assets]) if ground.surfaces else np.empty((0, 2, 3))
    if not len(boxes):
        return ground.grid
    low, high = boxes[:, 0, :2].min(axis=0), boxes[:, 1, :2].max(axis=0)
    x, y = np.meshgrid(*(np.linspace(start, end, MAX_CELLS) for start, end in zip(low, high, strict=True)))
    points = np.column_stack([x.ravel(), y.ravel()])
    relief = np.column_stack([points, _core.surface_heights(ground.surfaces, points)])
    return GroundGrid.of_bases(np.concatenate([relief, standing_bases(assets, kept, decisions)]))


def ground_change(asset: AssetRecord, ground: GroundGrid | None) -> str | None:
    """Returns why a photo without elevation model has to be imported again, as the end of the sentence "imported again because …"; None for any other
    asset and while its ground is the same."""
    rasters = asset.report.get("rasters")
    if rasters is None or rasters["elevation"] or asset.report.get("ground") == (None if ground is None else ground.digest):
        return None
    return "the ground of its photos changed"
