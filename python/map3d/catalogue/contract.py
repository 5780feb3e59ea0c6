"""The contract of catalogues: scenes, assets, renderings, jobs (spec/catalogue.md). The tests in tests/catalogue run on every home."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

from map3d.catalogue.records import AssetRecord, Job, JobResult, Lease, PlanCounts, PlannedJob, RenderingRecord, SceneCrs, SceneRecord
from map3d.catalogue.states import State
from map3d.geometry.frames import PinnedFrame
from map3d.types import BlockId, Layer, Vec3

LEASE_S = 60.0
HEARTBEAT_S = 15.0


class Catalogue(Protocol):
    """Safe to share between threads and between processes. Time is the database's."""

    lease_s: float
    """For how long a lease or heartbeat holds."""

    def close(self) -> None: ...

    # -- scenes and assets ------------------------------------------------------------------------------------------------------

    def create_scene(self, scene: SceneRecord) -> None:
        """Raises AlreadyExists."""

    def scene(self, name: str) -> SceneRecord:
        """Raises NotFound, naming the scenes there are."""

    def scenes(self) -> list[SceneRecord]:
        """By name."""

    def pin_scene(self, name: str, crs: SceneCrs | None = None, origin: Vec3 | None = None) -> SceneRecord:
        """Sets what is still None and returns what then holds: the first to pin wins. The same system with its vertical part named counts as new
        as long as the scene has no asset."""

    def set_built(self, name: str, fingerprint: str) -> None: ...

    def put_asset(self, asset: AssetRecord) -> None:
        """Adds an asset or replaces the one of that name."""

    def assets(self, scene: str) -> list[AssetRecord]:
        """By name."""

    # -- renderings -------------------------------------------------------------------------------------------------------------

    def create_rendering(self, rendering: RenderingRecord) -> None:
        """Raises AlreadyExists, NotFound (the scene)."""

    def rendering(self, name: str) -> RenderingRecord:
        """Raises NotFound, naming the renderings there are."""

    def renderings(self, scene: str | None = None) -> list[RenderingRecord]:
        """By name."""

    def regrid(self, rendering: RenderingRecord) -> RenderingRecord:
        """Puts `rendering` (pinned anew) in place of the one of its name: no jobs, content version one up; returns it as kept."""

    def add_frames(self, name: str, frames: Sequence[PinnedFrame]) -> RenderingRecord:
        """Adds views to a rendering and returns it as kept; its jobs stay. Raises NotFound, AlreadyExists for a view that it has."""

    def add_pass(self, name: str, layers: Sequence[Layer]) -> RenderingRecord:
        """Adds layers to a rendering, as a pass of their own, and returns it as kept; its jobs stay. Raises NotFound, AlreadyExists for a name that
        it has."""

    def announce(self, name: str, version: int) -> None:
        """A manifest of this content version may have been seen by clients."""

    # -- jobs -------------------------------------------------------------------------------------------------------------------

    def plan(self, rendering: str, jobs: Iterable[PlannedJob]) -> PlanCounts:
        """Adds jobs, reopens those whose key changed, keeps the rest; all in one transaction.

        A base job opens as todo; a reduce job as waiting, or todo when all blocks below are done. If jobs are open afterwards and the content
        version has been announced, it is raised by one.
        """

    def lease(self, rendering: str, worker: str, start: int = 0) -> Lease | None:
        """Takes the next job, in one atomic statement; None when there is none to take now. Expired leases are given back first.

        By fewest attempts, level, track; among these the first at or behind Morton number `start`, else the first of all: so a worker can stay where
        it is.
        """

    def heartbeat(self, lease: Lease) -> None:
        """Holds the lease for another `lease_s`; raises StaleFence."""

    def done(self, lease: Lease, result: JobResult) -> None:
        """Raises StaleFence. Wakes the reduce job above when it was the last one below it."""

    def fail(self, lease: Lease, reason: str) -> State:
        """Raises StaleFence. Returns todo, or quarantined after the third attempt."""

    def release(self, lease: Lease) -> None:
        """Gives a job back that was not tried to its end (the worker stops): its attempt does not count. Raises StaleFence."""

    def retry(self, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None = None) -> int:
        """Quarantined jobs (all, or those of these tracks and blocks) become todo with no attempts; returns how many."""

    def jobs(self, rendering: str, track: str | None = None, state: State | None = None) -> Iterator[Job]:
        """By track, level, Morton order."""

    def count_jobs(self, rendering: str) -> dict[State, int]:
        """All states, also those with none. Expired leases count as what they became."""
