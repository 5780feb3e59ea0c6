"""The catalogue: scenes, assets, renderings and jobs (spec/catalogue.md). One contract with one or more implementations."""

from map3d.catalogue.contract import HEARTBEAT_S, LEASE_S, Catalogue
from map3d.catalogue.open_catalogue import open_catalogue
from map3d.catalogue.records import (
    AssetRecord,
    Job,
    JobResult,
    Lease,
    PlanCounts,
    PlannedJob,
    RenderingRecord,
    SceneCrs,
    SceneRecord,
    Track,
)
from map3d.catalogue.states import State
from map3d.catalogue.workspace import Workspace

__all__ = [
    "HEARTBEAT_S",
    "LEASE_S",
    "AssetRecord",
    "Catalogue",
    "Job",
    "JobResult",
    "Lease",
    "PlanCounts",
    "PlannedJob",
    "RenderingRecord",
    "SceneCrs",
    "SceneRecord",
    "State",
    "Track",
    "Workspace",
    "open_catalogue",
]
