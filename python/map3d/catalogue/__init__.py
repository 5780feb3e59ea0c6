"""The catalogue: scenes, assets, renderings, jobs and operations (spec/catalogue.md). One contract with one or more implementations."""

from map3d.catalogue.account_records import ROLES, Role, TokenRecord, UserRecord
from map3d.catalogue.contract import HEARTBEAT_S, LEASE_S, Catalogue
from map3d.catalogue.open_catalogue import open_catalogue
from map3d.catalogue.operation_records import LogLine, OperationLease, OperationRecord, OperationState
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
    "ROLES",
    "AssetRecord",
    "Catalogue",
    "Job",
    "JobResult",
    "Lease",
    "LogLine",
    "OperationLease",
    "OperationRecord",
    "OperationState",
    "PlanCounts",
    "PlannedJob",
    "RenderingRecord",
    "Role",
    "SceneCrs",
    "SceneRecord",
    "State",
    "TokenRecord",
    "Track",
    "UserRecord",
    "Workspace",
    "open_catalogue",
]
