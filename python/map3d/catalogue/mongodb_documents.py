"""The documents of jobs in MongoDB, and the parts of queries and updates that several operations share."""

import secrets
from collections.abc import Iterable
from dataclasses import asdict
from datetime import datetime
from typing import Any, Final

from map3d.catalogue.codec import dump_bits, load_bits
from map3d.catalogue.records import Job, JobResult, Lease, PlannedJob
from map3d.catalogue.states import State
from map3d.geometry.morton import morton
from map3d.messages import load_text
from map3d.types import BlockId

Document = dict[str, Any]

ORDER: Final = [("tries", 1), ("z", 1), ("ground", 1), ("track", 1), ("morton", 1)]
"""The order in which jobs are leased. `tries`: attempts and expired leases."""
EXPIRES: Final = {"$add": ["$renewed", "$lease_ms"]}
HELD: Final = {"$expr": {"$gte": [EXPIRES, "$$NOW"]}}
OVERDUE: Final = {"$expr": {"$lt": [EXPIRES, "$$NOW"]}}
"""`renewed` is written by $currentDate, so both sides are on the server's clock."""
FORGET: Final[Document] = {"attempts": 0, "expiries": 0, "tries": 0, "worker": None, "reason": None}


def job_id(rendering: str, track: str, block: BlockId) -> str:
    """Returns an id whose order is that of track, level and Morton number. A space sorts before all characters of names and tracks."""
    return f"{rendering} {track} {block.z:02} {morton(block.x, block.y):016x}"


def ids_between(rendering: str, track: str | None) -> tuple[str, str]:
    """Returns bounds between which the ids of all jobs of the rendering, or of its track, sort."""
    prefix = rendering if track is None else f"{rendering} {track}"
    return f"{prefix} ", f"{prefix}!"


def new_call() -> str:
    """Returns a random value that marks the documents changed by one call, so that a repeated call recognises that it succeeded."""
    return secrets.token_hex(8)


def job_document(rendering: str, job: PlannedJob, fence: int) -> Document:
    return {
        "_id": job_id(rendering, job.track, job.block),
        "rendering": rendering,
        "track": job.track,
        "z": job.block.z,
        "x": job.block.x,
        "y": job.block.y,
        "kind": job.kind,
        "morton": job.order,
        "parent": parent_id(rendering, job),
        "fence": fence,
        "leased": None,
        "ended": None,
        "result": None,
        **planned_fields(job),
    }


def planned_fields(job: PlannedJob) -> Document:
    """Returns the fields that a plan sets. A reduce job waits until a sweep finds all blocks below it done."""
    return {"key": job.key, "ground": job.ground, "state": State.TODO if job.kind == "base" else State.WAITING, **FORGET}


def parent_id(rendering: str, job: PlannedJob) -> str | None:
    return None if job.parent is None else job_id(rendering, job.track, job.parent)


def ids_of(rendering: str, blocks: Iterable[tuple[str, BlockId]]) -> list[str]:
    return [job_id(rendering, track, block) for track, block in blocks]


def dump_result(result: JobResult) -> Document:
    return asdict(result) | {"occupied": dump_bits(result.occupied)}


def _ground(document: Document) -> int:
    """A program of catalogue version 1 that still runs beside a newer one plans jobs without a Hilbert index."""
    ground: int = document["ground" if "ground" in document else "morton"]
    return ground


def load_lease(document: Document, content_version: int) -> Lease:
    return Lease(
        rendering=document["rendering"],
        track=document["track"],
        block=_block(document),
        kind=document["kind"],
        key=document["key"],
        fence=document["fence"],
        attempt=document["attempts"],
        worker=document["worker"],
        content_version=content_version,
        ground=_ground(document),
    )


def load_job(document: Document) -> Job:
    names = ("rendering", "track", "kind", "key", "attempts", "expiries", "fence", "worker")
    state = State(document["state"])
    return Job(
        **{name: document[name] for name in names},
        block=_block(document),
        state=state,
        reason=load_text(document["reason"]),
        expires_s=_expires_s(document) if state is State.LEASED else None,
        ground=_ground(document),
        leased_s=_seconds(document["leased"]),
        ended_s=_seconds(document["ended"]),
        result=None if document["result"] is None else _load_result(document["result"]),
    )


def _block(document: Document) -> BlockId:
    return BlockId(document["z"], document["x"], document["y"])


def _expires_s(document: Document) -> float:
    renewed: datetime = document["renewed"]
    lease_ms: int = document["lease_ms"]
    return renewed.timestamp() + lease_ms / 1000


def _seconds(time: datetime | None) -> float | None:
    return None if time is None else time.timestamp()


def _load_result(value: Document) -> JobResult:
    return JobResult(**{**value, "occupied": load_bits(value["occupied"])})
