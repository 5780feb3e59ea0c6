"""Whether all heights of a scene are of the height system that it states."""

from collections.abc import Mapping, Sequence

import numpy as np

from map3d.catalogue import SceneRecord
from map3d.coherence.ground import Ground
from map3d.coherence.heights import HeightDecision
from map3d.coherence.surveyed_assets import SurveyedAsset
from map3d.errors import CrsError
from map3d.geometry.crs import is_local, parse_crs, vertical_crs_name


def share_heights(record: SceneRecord, assets: Sequence[SurveyedAsset], decisions: Mapping[str, HeightDecision], ground: Ground) -> bool:
    """Returns whether the height system of the scene may be stated: each file has it, was transformed to it, or says nothing about its heights and
    agrees with the ground of the others."""
    if record.crs is None or record.crs.vertical is None:
        return True
    stated = {asset.name: _states(asset, record.crs.vertical) for asset in assets}
    if any(value is False for value in stated.values()):
        return False
    agreeing = {name for name, decision in decisions.items() if np.isfinite(ground.terrain[name]).any() and not _contradicts(decision)}
    open_ones = [asset for asset in assets if stated[asset.name] is None and (asset.has_heights or (not asset.is_raster and asset.drawn.any()))]
    is_terrain_known = any(stated[name] for name in agreeing) or any(stated[asset.name] for asset in assets if asset.has_heights)
    return all(is_terrain_known and (asset.is_raster or asset.name in agreeing) for asset in open_ones)


def _states(asset: SurveyedAsset, vertical: str) -> bool | None:
    """Returns whether the heights of an asset are of a height system; None if it says nothing about them."""
    report = asset.record.report
    if str(report.get("placing", {}).get("heights", "")).startswith("transformed"):
        return True
    name = report.get("inputs", {}).get("options", {}).get("crs") or report.get("crs")
    if not isinstance(name, str) or is_local(name):
        return None
    try:
        own = vertical_crs_name(parse_crs(name))
    except CrsError:
        return None
    return None if own is None else own == vertical


def _contradicts(decision: HeightDecision) -> bool:
    return any("offset" in found.get("values", {}) for found in decision.findings)
