"""Leases and queries of jobs in MongoDB: every transition of states.py is one update that checks the state it starts from.

Times are on the server's clock: `renewed` is written by $currentDate and compared with $$NOW.
"""

import math
import time
from collections.abc import Iterable, Iterator
from typing import Any, Final

from pymongo import ReturnDocument

from map3d.catalogue.mongodb_connection import MongoConnection
from map3d.catalogue.mongodb_documents import HELD, ORDER, OVERDUE, Document, dump_result, ids_between, job_id, load_job, load_lease, new_call
from map3d.catalogue.mongodb_plan import PAGE, MongoPlan
from map3d.catalogue.records import Job, JobResult, Lease
from map3d.catalogue.states import MAX_ATTEMPTS, MAX_EXPIRIES, JobEvent, State, next_state
from map3d.errors import StaleFence
from map3d.messages import Message, dump_text, message
from map3d.types import BlockId

_EXPIRE_EVERY: Final = 0.25
"""Share of the lease time after which a process looks for overdue leases again."""
_EXPIRE_IDLE_S: Final = 1.0
"""The same in seconds when there is no job to do."""
_ONE_MORE: Final[Document] = {"attempts": 1, "tries": 1, "fence": 1}
"""What a lease increments."""


class MongoJobs(MongoPlan):
    """The job methods of the MongoDB catalogue."""

    def __init__(self, connection: MongoConnection, lease_s: float) -> None:
        self._connection = connection
        self.lease_s = lease_s
        self._expired_s: dict[str, float] = {}

    # -- leases -----------------------------------------------------------------------------------------------------------------

    def lease(self, rendering: str, worker: str, start: int = 0) -> Lease | None:
        """Expires overdue leases regularly, and when there is no other job: an expired job is the last in the order anyway."""
        every_s = _EXPIRE_EVERY * self.lease_s
        self._expire_overdue_after(rendering, every_s)
        document = self._lease_next(rendering, worker, start)
        if document is None and self._expire_overdue_after(rendering, min(_EXPIRE_IDLE_S, every_s)):
            document = self._lease_next(rendering, worker, start)
        if document is None:
            return None
        return load_lease(document, self._versions(rendering)["content_version"])

    def _lease_next(self, rendering: str, worker: str, start: int) -> Document | None:
        call, jobs = new_call(), self._connection.collection("job")
        todo: Document = {"rendering": rendering, "state": State.TODO}
        change = {
            "$set": {"state": next_state(State.TODO, JobEvent.LEASE), "worker": worker, "lease_ms": int(self.lease_s * 1000), "call": call},
            "$inc": _ONE_MORE,
            "$currentDate": {"renewed": True, "leased": True},
        }

        def act(repeated: bool) -> Document | None:
            if repeated and (mine := jobs.find_one({"rendering": rendering, "state": State.LEASED, "worker": worker, "call": call})):
                return mine
            first = jobs.find_one(todo, {"tries": 1, "z": 1}, sort=ORDER) if start else None
            if first is not None:
                group = todo | {name: first[name] for name in ("tries", "z")} | {"ground": {"$gte": start}}
                found = jobs.find_one_and_update(group, change, sort=ORDER, return_document=ReturnDocument.AFTER)
                if found is not None:
                    return found
            return jobs.find_one_and_update(todo, change, sort=ORDER, return_document=ReturnDocument.AFTER)

        return self._connection.run(act)

    def lease_block(self, rendering: str, worker: str, track: str, block: BlockId) -> Lease | None:
        self._expire_block(rendering, track, block)
        return self._lease_one(rendering, track, block, {"state": State.TODO}, self._leased_by(worker) | {"$inc": _ONE_MORE})

    def evict(self, rendering: str, worker: str, track: str, block: BlockId) -> Lease | None:
        """Makes the job above wait before and after it takes the job, since a sweep may open it in between."""
        found = self._find("job", {"_id": job_id(rendering, track, block), "state": State.DONE, "kind": "base"}, {"parent": 1})
        if not found or not self._exists({"rendering": rendering, "state": {"$ne": State.DONE}}):
            return None
        change = self._leased_by(worker)
        change = change | {"$set": {**change["$set"], "attempts": 1, "tries": 1, "expiries": 0}, "$inc": {"fence": 1}}
        self._wait_above_evicted(found[0]["parent"])
        lease = self._lease_one(rendering, track, block, {"state": State.DONE}, change)
        self._wait_above_evicted(found[0]["parent"])
        return lease

    def _leased_by(self, worker: str) -> Document:
        leased = {"state": State.LEASED, "worker": worker, "lease_ms": int(self.lease_s * 1000)}
        return {"$set": leased, "$currentDate": {"renewed": True, "leased": True}}

    def _lease_one(self, rendering: str, track: str, block: BlockId, condition: Document, change: Document) -> Lease | None:
        name, call, jobs = job_id(rendering, track, block), new_call(), self._connection.collection("job")
        marked = {**change, "$set": {**change["$set"], "call": call}}

        def act(repeated: bool) -> Document | None:
            leased = jobs.find_one_and_update({"_id": name, **condition}, marked, return_document=ReturnDocument.AFTER)
            return leased or (jobs.find_one({"_id": name, "state": State.LEASED, "call": call}) if repeated else None)

        document = self._connection.run(act)
        return None if document is None else load_lease(document, self._versions(rendering)["content_version"])

    def _expire_block(self, rendering: str, track: str, block: BlockId) -> None:
        for document in self._find("job", {"_id": job_id(rendering, track, block), "state": State.LEASED, **OVERDUE}):
            self._expire_one(document, OVERDUE)

    def heartbeat(self, lease: Lease) -> None:
        self._move(lease, {"$set": {"lease_ms": int(self.lease_s * 1000)}, "$currentDate": {"renewed": True}})

    def done(self, lease: Lease, result: JobResult) -> None:
        change = {"state": next_state(State.LEASED, JobEvent.DONE), "worker": None, "reason": None, "result": dump_result(result)}
        document = self._move(lease, {"$set": change, "$currentDate": {"ended": True}})
        self._open_above(document["parent"])

    def fail(self, lease: Lease, reason: Message) -> State:
        again = next_state(State.LEASED, JobEvent.FAIL)
        state = State.QUARANTINED if again is None or lease.attempt >= MAX_ATTEMPTS else again
        self._move(lease, {"$set": {"state": state, "worker": None, "reason": dump_text(reason)}})
        return state

    def release(self, lease: Lease) -> None:
        change = {"state": next_state(State.LEASED, JobEvent.RELEASE), "worker": None}
        self._move(lease, {"$set": change, "$inc": {"attempts": -1, "tries": -1}})

    def expire(self, rendering: str, workers: Iterable[str]) -> int:
        query = {"rendering": rendering, "state": State.LEASED, "worker": {"$in": sorted(set(workers))}}
        return sum(self._expire_one(document, {}) for document in self._find("job", query))

    def _expire_overdue_after(self, rendering: str, seconds: float) -> int:
        """Expires overdue leases unless this process did so within `seconds`; returns their number."""
        now = time.monotonic()
        if now - self._expired_s.get(rendering, -math.inf) < seconds:
            return 0
        self._expired_s[rendering] = now
        overdue = self._find("job", {"rendering": rendering, "state": State.LEASED, **OVERDUE})
        return sum(self._expire_one(document, OVERDUE) for document in overdue)

    def _expire_one(self, document: Document, condition: Document) -> int:
        """Expires a lease unless it has changed; returns the number of expired leases. `tries` stays, since an expiry replaces an attempt."""
        expiries = document["expiries"] + 1
        change = {
            "state": State.QUARANTINED if expiries >= MAX_EXPIRIES else next_state(State.LEASED, JobEvent.EXPIRE),
            "expiries": expiries,
            "attempts": document["attempts"] - 1,
            "worker": None,
            "reason": dump_text(message("lease-expired", count=expiries, worker=document["worker"])),
        }
        held = {"_id": document["_id"], "state": State.LEASED, "fence": document["fence"], **condition}
        return self._update_many(held, {"$set": change})

    def _move(self, lease: Lease, change: dict[str, Any]) -> Document:
        """Moves a leased job to another state and returns it; raises StaleFence when the lease is no longer held."""
        name, call, jobs = job_id(lease.rendering, lease.track, lease.block), new_call(), self._connection.collection("job")
        held = {"_id": name, "state": State.LEASED, "fence": lease.fence, "worker": lease.worker, **HELD}
        marked = {**change, "$set": {**change["$set"], "call": call}}

        def act(repeated: bool) -> Document | None:
            moved = jobs.find_one_and_update(held, marked, return_document=ReturnDocument.AFTER)
            return moved or (jobs.find_one({"_id": name, "call": call}) if repeated else None)

        document = self._connection.run(act)
        if document is None:
            raise StaleFence(
                f"job {lease.track} {lease.block}: the lease of {lease.worker} (fence {lease.fence}) is no longer held; {self._holder(name)}"
            )
        return document

    def _holder(self, name: str) -> str:
        found = self._find("job", {"_id": name}, {"state": 1, "fence": 1, "worker": 1})
        if not found:
            return "the job no longer exists"
        worker = f", leased by {found[0]['worker']}" if found[0]["worker"] else ""
        return f"the job is {found[0]['state']} with fence {found[0]['fence']}{worker}"

    # -- queries ----------------------------------------------------------------------------------------------------------------

    def jobs(self, rendering: str, track: str | None = None, state: State | None = None) -> Iterator[Job]:
        after, end = ids_between(rendering, track)
        query: Document = {} if state is None else {"rendering": rendering, "state": state}
        while page := self._find("job", query | {"_id": {"$gt": after, "$lt": end}}, limit=PAGE):
            yield from map(load_job, page)
            after = page[-1]["_id"]

    def job(self, rendering: str, track: str, block: BlockId) -> Job | None:
        found = self._find("job", {"_id": job_id(rendering, track, block)})
        return load_job(found[0]) if found else None

    def jobs_below(self, rendering: str, track: str, block: BlockId) -> list[Job]:
        return [load_job(document) for document in self._find("job", {"parent": job_id(rendering, track, block)})]

    def clock_s(self) -> float:
        return self._connection.run(lambda _: self._connection.clock()).timestamp()

    def has_open_jobs(self, rendering: str) -> bool:
        return self._any_in(rendering, (State.TODO, State.LEASED))

    def count_jobs(self, rendering: str) -> dict[State, int]:
        self._check_rendering(rendering)
        pipeline: list[Document] = [{"$match": {"rendering": rendering}}, {"$group": {"_id": "$state", "jobs": {"$sum": 1}}}]
        found = self._connection.run(lambda _: list(self._connection.collection("job").aggregate(pipeline)))
        counts = {document["_id"]: document["jobs"] for document in found}
        return {state: counts.get(state, 0) for state in State}
