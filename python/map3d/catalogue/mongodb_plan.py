"""Operations that open and close jobs in MongoDB: plan, sweep, retry, cancel, reopen.

No operation uses a transaction over several documents. Each is a sequence of steps that can be repeated after a kill (spec/catalogue.md).
A reduce job opens only if its fence is the same as before the blocks below it were looked at, and every operation that opens a block increments
the fences above it afterwards; so a reduce job never stays open above a block that is not done.
"""

from collections.abc import Iterable
from itertools import groupby, islice
from typing import Any, Final

from pymongo import InsertOne, UpdateOne
from pymongo.errors import BulkWriteError

from map3d.catalogue.mongodb_connection import MongoConnection
from map3d.catalogue.mongodb_documents import FORGET, Document, ids_of, job_document, job_id, new_call, parent_id, planned_fields
from map3d.catalogue.records import FENCES_PER_VERSION, PlanCounts, PlannedJob
from map3d.catalogue.states import OPEN, JobEvent, State, next_state, sources
from map3d.errors import NotFound
from map3d.types import BlockId

PLAN_BATCH: Final = 1_000
"""Jobs that are planned together."""
PAGE: Final = 1_000
"""Jobs that one query reads."""
_DUPLICATE_KEY: Final = 11000

_WAITING: Final = next_state(State.WAITING, JobEvent.BELOW_REOPENED)
_OPENED: Final = next_state(State.WAITING, JobEvent.BELOW_DONE)


class MongoPlan:
    """The operations of the MongoDB catalogue that open and close jobs."""

    _connection: MongoConnection

    def plan(self, rendering: str, jobs: Iterable[PlannedJob]) -> PlanCounts:
        self._check_rendering(rendering)
        counts, remaining = PlanCounts(), iter(jobs)
        while batch := list(islice(remaining, PLAN_BATCH)):
            counts += self._plan_batch(rendering, batch)
        self.sweep(rendering)
        if self._any_in(rendering, OPEN):
            self._raise_version(rendering)
        self._set_planning(rendering, False)
        return counts

    def sweep(self, rendering: str) -> int:
        query: Document = {"rendering": rendering, "state": State.WAITING}
        opened, after = 0, ""
        while waiting := self._find("job", query | {"_id": {"$gt": after}}, {"fence": 1}, limit=PAGE):
            opened += self._open_unblocked({document["_id"]: document["fence"] for document in waiting})
            after = waiting[-1]["_id"]
        return opened

    def retry(self, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None = None) -> int:
        self._check_rendering(rendering)
        query = _selected(rendering, blocks, sources(JobEvent.RETRY))
        if self._exists(query):
            self._raise_version(rendering)
        count = self._open_again(query, {"attempts": 0, "expiries": 0, "tries": 0}, fence=0)
        self.sweep(rendering)
        return count

    def cancel(self, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None = None) -> int:
        self._check_rendering(rendering)
        change = {"$set": {**FORGET, "state": State.CANCELLED}, "$inc": {"fence": 1}}
        return self._update_many(_selected(rendering, blocks, sources(JobEvent.CANCEL)), change)

    def reopen(self, rendering: str, blocks: Iterable[tuple[str, BlockId]]) -> int:
        """Makes the jobs above wait before it changes the jobs, since a repeated call finds only jobs that are still done; and once more
        afterwards, since a sweep may have opened them in between."""
        self._check_rendering(rendering)
        query = _selected(rendering, blocks, sources(JobEvent.REOPEN))
        done = self._find("job", query, {"parent": 1})
        if not done:
            return 0
        above = {document["parent"] for document in done}
        self._raise_version(rendering)
        count = self._wait_above(above - {document["_id"] for document in done})
        count += self._open_again(query, FORGET, fence=1)
        self._wait_above(above)
        self.sweep(rendering)
        return count

    # -- steps ------------------------------------------------------------------------------------------------------------------

    def _plan_batch(self, rendering: str, jobs: list[PlannedJob]) -> PlanCounts:
        ids = [job_id(rendering, job.track, job.block) for job in jobs]
        known = {document["_id"]: document for document in self._find("job", {"_id": {"$in": ids}}, {"key": 1, "state": 1})}
        opened = [job for job, name in zip(jobs, ids, strict=True) if name not in known or _is_changed(known[name], job)]
        added = sum(job_id(rendering, job.track, job.block) not in known for job in opened)
        if opened:
            self._set_planning(rendering, True)
            fence = self._raise_version(rendering) * FENCES_PER_VERSION
            for _, level in groupby(sorted(opened, key=lambda job: -job.block.z), key=lambda job: job.block.z):
                self._write_planned(rendering, list(level), known.keys(), fence)
        return PlanCounts(added, len(opened) - added, len(jobs) - len(opened))

    def _write_planned(self, rendering: str, jobs: list[PlannedJob], known: Iterable[str], fence: int) -> None:
        """Writes jobs of one level, then makes the jobs above them wait."""
        writes: list[InsertOne[Document] | UpdateOne] = []
        for job in jobs:
            name = job_id(rendering, job.track, job.block)
            update = {"$set": planned_fields(job), "$inc": {"fence": 1}}
            writes.append(UpdateOne({"_id": name}, update) if name in known else InsertOne(job_document(rendering, job, fence)))
        self._connection.run(lambda _repeated: _write_tolerating_duplicates(self, writes))
        self._wait_above({parent_id(rendering, job) for job in jobs})

    def _wait_above(self, above: Iterable[str | None]) -> int:
        """Makes these reduce jobs and all above them wait for the blocks below; returns the number of jobs that did not wait."""
        moved, ids = 0, {name for name in above if name is not None}
        others = [state for state in sources(JobEvent.BELOW_REOPENED) if state is not State.WAITING]
        while ids:
            found = self._find("job", {"_id": {"$in": sorted(ids)}}, {"parent": 1})
            if found:
                these = {"_id": {"$in": [document["_id"] for document in found]}}
                self._update_many(these | {"state": State.WAITING}, {"$inc": {"fence": 1}})
                change = {"$set": {**FORGET, "state": _WAITING}, "$inc": {"fence": 1}}
                moved += self._update_many(these | {"state": {"$in": others}}, change)
            ids = {document["parent"] for document in found} - {None}
        return moved

    def _wait_above_evicted(self, above: str | None) -> None:
        """Makes the reduce job above an evicted block wait unless it is done; no job above that one is open."""
        if above is not None:
            self._update_many({"_id": above, "state": State.WAITING}, {"$inc": {"fence": 1}})
            change = {"$set": {**FORGET, "state": _WAITING}, "$inc": {"fence": 1}}
            self._update_many({"_id": above, "state": {"$in": [State.TODO, State.LEASED]}}, change)

    def _open_unblocked(self, fences: dict[str, int]) -> int:
        """Opens those of the waiting jobs whose blocks below are all done. `fences`: id → fence, read before the blocks below."""
        match = {"parent": {"$in": list(fences)}, "state": {"$ne": State.DONE}}
        pipeline: list[Document] = [{"$match": match}, {"$group": {"_id": "$parent"}}]
        blocked = {document["_id"] for document in self._connection.run(lambda _: list(self._connection.collection("job").aggregate(pipeline)))}
        return sum(self._open_waiting(name, fence) for name, fence in fences.items() if name not in blocked)

    def _open_above(self, parent: str | None) -> None:
        """Opens the reduce job above a done job when all blocks below it are done."""
        if parent is not None:
            waiting = self._find("job", {"_id": parent, "state": State.WAITING}, {"fence": 1})
            if waiting and not self._exists({"parent": parent, "state": {"$ne": State.DONE}}):
                self._open_waiting(parent, waiting[0]["fence"])

    def _open_waiting(self, name: str, fence: int) -> int:
        return self._update_many({"_id": name, "state": State.WAITING, "fence": fence}, {"$set": {"state": _OPENED}})

    def _open_again(self, query: Document, change: Document, fence: int) -> int:
        """Opens base jobs as todo and reduce jobs as waiting; returns their number."""
        kinds = {"base": State.TODO, "reduce": State.WAITING}
        changes = {kind: {"$set": {**change, "state": state}, "$inc": {"fence": fence}} for kind, state in kinds.items()}
        return sum(self._update_many(query | {"kind": kind}, change) for kind, change in changes.items())

    # -- the rendering ----------------------------------------------------------------------------------------------------------

    def _raise_version(self, rendering: str) -> int:
        """Increments the content version if clients may have seen it; returns it. Raises NotFound."""
        while True:
            versions = self._versions(rendering)
            content, announced = versions["content_version"], versions["announced_version"]
            if announced < content:
                return int(content)
            expected = {"_id": rendering, "content_version": content, "announced_version": announced}
            self._update_many(expected, {"$set": {"content_version": announced + 1}}, "rendering")

    def _versions(self, rendering: str) -> Document:
        found = self._find("rendering", {"_id": rendering}, {"content_version": 1, "announced_version": 1})
        if not found:
            raise NotFound(f"no rendering {rendering!r}")
        return found[0]

    def _check_rendering(self, rendering: str) -> None:
        self._versions(rendering)

    def _set_planning(self, rendering: str, planning: bool) -> None:
        self._update_many({"_id": rendering, "planning": int(not planning)}, {"$set": {"planning": int(planning)}}, "rendering")

    # -- queries ----------------------------------------------------------------------------------------------------------------

    def _find(self, collection: str, query: Document, fields: Document | None = None, limit: int = 0) -> list[Document]:
        """Returns the documents, ordered by id."""
        return self._connection.run(lambda _: list(self._connection.collection(collection).find(query, fields).sort("_id", 1).limit(limit)))

    def _exists(self, query: Document) -> bool:
        return self._connection.run(lambda _: self._connection.collection("job").find_one(query, {"_id": 1})) is not None

    def _any_in(self, rendering: str, states: Iterable[State]) -> bool:
        return self._exists({"rendering": rendering, "state": {"$in": list(states)}})

    def _update_many(self, query: Document, change: Document, collection: str = "job") -> int:
        """Returns the number of changed documents. Marks them with a random value, so that a repeated attempt also counts those of the first."""
        call, documents = new_call(), self._connection.collection(collection)
        marked = {**change, "$set": {**change.get("$set", {}), "call": call}}
        mine = {name: query[name] for name in ("_id", "rendering") if name in query} | {"call": call}

        def act(repeated: bool) -> int:
            changed = documents.update_many(query, marked).modified_count
            return documents.count_documents(mine) if repeated else changed

        return self._connection.run(act)


def _is_changed(known: Document, job: PlannedJob) -> bool:
    return bool(known["key"] != job.key or known["state"] == State.CANCELLED)


def _selected(rendering: str, blocks: Iterable[tuple[str, BlockId]] | None, states: Iterable[State]) -> dict[str, Any]:
    """Returns the query for the jobs in these states: all, or those of `blocks`."""
    query: Document = {"rendering": rendering, "state": {"$in": list(states)}}
    return query if blocks is None else query | {"_id": {"$in": ids_of(rendering, blocks)}}


def _write_tolerating_duplicates(plan: MongoPlan, writes: list[InsertOne[Document] | UpdateOne]) -> None:
    """Writes in any order. A job that exists was inserted by an earlier attempt, or by another process with the same plan."""
    try:
        plan._connection.collection("job").bulk_write(writes, ordered=False)
    except BulkWriteError as error:
        if any(each["code"] != _DUPLICATE_KEY for each in error.details["writeErrors"]):
            raise
