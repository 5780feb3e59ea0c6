"""The contract of catalogues: scenes, assets, renderings, jobs, operations (spec/catalogue.md). tests/catalogue checks every implementation."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Protocol, Self

from map3d.catalogue.account_records import TokenRecord, UserRecord
from map3d.catalogue.operation_contract import OperationCatalogue
from map3d.catalogue.records import AssetRecord, Job, JobResult, Lease, PlanCounts, PlannedJob, RenderingRecord, SceneCrs, SceneRecord
from map3d.catalogue.states import State
from map3d.geometry.frames import PinnedFrame
from map3d.messages import Message
from map3d.types import BlockId, Layer, Vec3

LEASE_S = 60.0
HEARTBEAT_S = 15.0


class Catalogue(OperationCatalogue, Protocol):
    """Safe to share between threads and between processes. All times are on the database's clock."""

    lease_s: float
    """Seconds after which a lease expires unless a heartbeat renews it."""

    def close(self) -> None: ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None:
        """Closes the catalogue."""

    # -- scenes and assets ------------------------------------------------------------------------------------------------------

    def create_scene(self, scene: SceneRecord) -> None:
        """Raises AlreadyExists."""

    def scene(self, name: str) -> SceneRecord:
        """Returns the scene. Raises NotFound, naming the existing scenes."""

    def scenes(self) -> list[SceneRecord]:
        """Returns all scenes, ordered by name."""

    def pin_scene(self, name: str, crs: SceneCrs | None = None, origin: Vec3 | None = None) -> SceneRecord:
        """Sets `crs` and `origin` where they are still None, and returns the scene: the first caller wins. While the scene has no asset, the same
        coordinate system with a vertical part replaces one without."""

    def set_built(self, name: str, digest: str) -> None: ...

    def set_scene_options(self, name: str, options: Mapping[str, Any]) -> None:
        """Replaces the options of a scene. Raises NotFound."""

    def put_asset(self, asset: AssetRecord) -> None:
        """Adds an asset, or replaces the asset with the same name."""

    def assets(self, scene: str) -> list[AssetRecord]:
        """Returns the assets of a scene, ordered by name."""

    def remove_asset(self, scene: str, name: str) -> None:
        """Removes the record of an asset; raises NotFound."""

    def remove_scene(self, name: str) -> None:
        """Removes the records of a scene and its assets. Raises NotFound, and BadRequest when the scene has renderings, naming them."""

    # -- renderings -------------------------------------------------------------------------------------------------------------

    def create_rendering(self, rendering: RenderingRecord) -> None:
        """Raises AlreadyExists, or NotFound when the scene does not exist. After a rendering with the same name was removed, the content version goes
        on from that of the removed one, so that neither caches of its tiles nor leases of its jobs are mistaken for new ones."""

    def rendering(self, name: str) -> RenderingRecord:
        """Returns the rendering. Raises NotFound, naming the existing renderings."""

    def renderings(self, scene: str | None = None) -> list[RenderingRecord]:
        """Returns the renderings of a scene, or all of them, ordered by name."""

    def regrid(self, rendering: RenderingRecord) -> RenderingRecord:
        """Replaces the rendering with the same name, removes its jobs and increments its content version; returns the stored record."""

    def add_frames(self, name: str, frames: Sequence[PinnedFrame]) -> RenderingRecord:
        """Adds views to a rendering and returns the stored record; its jobs stay. Raises NotFound, AlreadyExists for an existing view."""

    def add_pass(self, name: str, layers: Sequence[Layer]) -> RenderingRecord:
        """Adds layers to a rendering as a new pass and returns the stored record; its jobs stay. Raises NotFound, AlreadyExists for an existing
        name."""

    def describe_rendering(self, name: str, title: str, attribution: str, options: Mapping[str, Any]) -> RenderingRecord:
        """Replaces title, attribution and options of a rendering and returns the stored record. Raises NotFound."""

    def announce(self, name: str, version: int) -> None:
        """Records that clients may have seen a manifest with this content version."""

    def remove_rendering(self, name: str) -> None:
        """Removes the jobs of a rendering, in batches, and then its record; raises NotFound. After a kill it can be repeated."""

    # -- accounts ---------------------------------------------------------------------------------------------------------------

    def create_user(self, user: UserRecord) -> None:
        """Raises AlreadyExists."""

    def user(self, name: str) -> UserRecord:
        """Returns the user. Raises NotFound, naming the existing users."""

    def users(self) -> list[UserRecord]:
        """Returns all users, ordered by name."""

    def update_user(self, user: UserRecord) -> None:
        """Replaces password and role of the user with the same name; raises NotFound."""

    def remove_user(self, name: str) -> None:
        """Removes a user and the user's tokens; raises NotFound."""

    def create_token(self, token: TokenRecord) -> None:
        """Raises NotFound when the user does not exist, AlreadyExists."""

    def tokens(self, user: str | None = None) -> list[TokenRecord]:
        """Returns the tokens of a user, or all of them, ordered by id."""

    def find_token(self, digest: str) -> TokenRecord | None:
        """Returns the token with this digest, or None."""

    def remove_token(self, id: str) -> None:
        """Raises NotFound, naming the existing tokens."""

    # -- jobs -------------------------------------------------------------------------------------------------------------------

    def plan(self, rendering: str, jobs: Iterable[PlannedJob]) -> PlanCounts:
        """Adds jobs, reopens those whose key changed or that were cancelled, and leaves the others. Expects the jobs below a reduce job before it.

        Stores the jobs in batches while it reads them. A base job opens as todo; a reduce job as waiting. Reduce jobs above an opened job wait again,
        and their leases become stale. A sweep ends the plan. After a kill or an exception of `jobs`, the same plan can be made again and leads to the
        same jobs. If the content version has been announced, increments it before the first job opens, and when jobs are open at the end.
        """

    def sweep(self, rendering: str) -> int:
        """Opens waiting reduce jobs whose blocks below are all done; returns their number. Completes a `done` or `plan` that was killed."""

    def lease(self, rendering: str, worker: str, start: int = 0) -> Lease | None:
        """Leases the next job in one atomic statement, after expiring overdue leases. Returns None when no job is available now.

        The order is: fewest attempts and expired leases, lowest level; among these the first job with Hilbert index `start` or greater, else the
        first; of equal ground, the first track. A worker passes the Hilbert index of its last block to stay in the same region.
        """

    def lease_block(self, rendering: str, worker: str, track: str, block: BlockId) -> Lease | None:
        """Leases the job of this block if it is todo, out of turn, after expiring its overdue lease. Returns None otherwise."""

    def evict(self, rendering: str, worker: str, track: str, block: BlockId) -> Lease | None:
        """Leases the done job of a base block so that its tiles can be removed; `release` then opens the job. Reduce jobs above that are todo or
        leased wait for it again; done ones stay, since their tiles do not change. Returns None for any other job, and when all jobs of the rendering
        are done."""

    def heartbeat(self, lease: Lease) -> None:
        """Renews the lease for another `lease_s`; raises StaleFence."""

    def done(self, lease: Lease, result: JobResult) -> None:
        """Marks the job as done, then opens the reduce job above when all blocks below it are done; raises StaleFence. After a kill between the two
        steps, `sweep` does the second."""

    def fail(self, lease: Lease, reason: Message) -> State:
        """Returns the new state: todo, or quarantined after the third attempt. Raises StaleFence."""

    def release(self, lease: Lease) -> None:
        """Releases a job whose worker stops before finishing it; the attempt does not count. Raises StaleFence."""

    def expire(self, rendering: str, workers: Iterable[str]) -> int:
        """Expires the leases of workers that no longer run, before their time; returns the number of leases.

        An expired lease does not count as an attempt. The tenth quarantines the job.
        """

    def retry(self, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None = None) -> int:
        """Reopens quarantined and cancelled jobs (all, or those of these tracks and blocks) with no attempts and expired leases; returns their
        number."""

    def cancel(self, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None = None) -> int:
        """Cancels open jobs (all, or those of these tracks and blocks) and makes their leases stale; returns their number. The next `plan` or `retry`
        reopens them."""

    def reopen(self, rendering: str, blocks: Iterable[tuple[str, BlockId]]) -> int:
        """Reopens done jobs, and makes the reduce jobs above them wait for them, so that they are done again; returns the number of jobs of both
        kinds. Jobs that are not done stay as they are."""

    def jobs(self, rendering: str, track: str | None = None, state: State | None = None) -> Iterator[Job]:
        """Yields the jobs, ordered by track, level and Morton number. Reads them in pages, each of which shows the state of its moment."""

    def job(self, rendering: str, track: str, block: BlockId) -> Job | None:
        """Returns the job of a block; None if it is not planned."""

    def jobs_below(self, rendering: str, track: str, block: BlockId) -> list[Job]:
        """Returns the jobs whose seams a reduce job reads, in Morton order; none for a base block."""

    def clock_s(self) -> float:
        """Returns the present time on the database's clock, in seconds since 1970."""

    def has_open_jobs(self, rendering: str) -> bool:
        """Returns whether any job is todo or leased, from one index look-up; idle workers ask this."""

    def count_jobs(self, rendering: str) -> dict[State, int]:
        """Returns the number of jobs in every state. Overdue leases count as leased until a worker asks for a job. Raises NotFound."""
