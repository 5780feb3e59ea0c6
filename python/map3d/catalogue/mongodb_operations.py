"""Operations in MongoDB, without a transaction over several documents (spec/catalogue.md).

A lease is a claim on the scene: one document of `operation_lock` per scene names the operation that runs, with a fence that rises with every lease.
So two operations of one scene never run at the same time. The operation's own document follows that of the scene; where a kill left it behind, the
next `lease_operation` brings it in line.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from pymongo import ReplaceOne, ReturnDocument

from map3d.catalogue import operation_records as rules
from map3d.catalogue.mongodb_documents import HELD, OVERDUE, Document, new_call
from map3d.catalogue.mongodb_jobs import MongoJobs
from map3d.catalogue.operation_contract import LOG_PAGE
from map3d.catalogue.operation_records import ENDED, REPEATABLE, UNENDED, LogLine, NewOperation, OperationLease, OperationRecord, OperationState
from map3d.catalogue.states import MAX_EXPIRIES
from map3d.errors import NotFound, StaleFence
from map3d.messages import Message, dump_text, load_text, verbatim

_WAITING, _RUNNING = OperationState.WAITING, OperationState.RUNNING
_ENDED_NOW: Final = {"$currentDate": {"ended": True}}
_FRESH: Final[Document] = {
    "stage": "",
    "done": 0,
    "total": 0,
    "message": "",
    "started": None,
    "ended": None,
    "worker": None,
    "expiries": 0,
    "cancelling": False,
}


class MongoOperations(MongoJobs):
    """The operation methods of the MongoDB catalogue."""

    # -- asking -----------------------------------------------------------------------------------------------------------------

    def create_operation(self, kind: str, target: str, arguments: Mapping[str, Any], asked_by: str) -> OperationRecord:
        new = NewOperation(kind, target, arguments, asked_by)
        scene = self._scene_of(new)
        created = self._connection.run(lambda _: self._connection.clock())
        document = {"kind": kind, "target": target, "scene": scene, "arguments": new.arguments_json, "asked_by": asked_by, "created": created}
        document |= {**_FRESH, "state": _WAITING, "fence": 0, "lines": 0, "call": new_call()}
        number = self._next_number()
        while not self._connection.insert("operation", {"_id": number, **document}):
            number = self._next_number()
        self._prune()
        return self.operation(str(number))

    def operation(self, id: str) -> OperationRecord:
        return _load(self._operation(rules.operation_number(id)))

    def operations(
        self,
        target: str | None = None,
        states: Sequence[OperationState] | None = None,
        limit: int = 100,
        *,
        scene: str | None = None,
        before: str | None = None,
    ) -> list[OperationRecord]:
        query: Document = {name: value for name, value in (("target", target), ("scene", scene)) if value is not None}
        if states is not None:
            query["state"] = {"$in": [OperationState(state) for state in states]}
        if before is not None:
            query["_id"] = {"$lt": rules.operation_number(before)}
        found = self._connection.collection("operation").find
        return [_load(document) for document in self._connection.run(lambda _: list(found(query).sort("_id", -1).limit(limit)))]

    def cancel_operation(self, id: str) -> OperationRecord:
        """Ends the operation itself when its worker's lease is overdue."""
        number = self._operation(rules.operation_number(id))["_id"]
        cancelled = {"state": OperationState.CANCELLED, "message": rules.CANCELLED_MESSAGE}
        self._update_many({"_id": number, "state": _WAITING}, {"$set": cancelled, **_ENDED_NOW}, "operation")
        self._update_many({"_id": number, "state": _RUNNING}, {"$set": {"cancelling": True}}, "operation")
        document = self._operation(number)
        if document["state"] == _RUNNING and not self._find("operation_lock", {**_held(document), **HELD}):
            self._expire_operation(document)
        found = self.operation(id)
        if found.state not in (_RUNNING, OperationState.CANCELLED):
            raise rules.uncancellable(found)
        return found

    def retry_operation(self, id: str) -> OperationRecord:
        number = rules.operation_number(id)
        repeatable = {"_id": number, "state": {"$in": list(REPEATABLE)}}
        if not self._update_many(repeatable, {"$set": {**_FRESH, "state": _WAITING}}, "operation"):
            raise rules.unretryable(self.operation(id))
        return self.operation(id)

    # -- doing ------------------------------------------------------------------------------------------------------------------

    def lease_operation(self, worker: str) -> OperationLease | None:
        busy = set[str]()
        for document in self._find("operation", {"state": {"$in": list(UNENDED)}}, {"scene": 1}):
            scene, number = document["scene"], document["_id"]
            fence = None if scene in busy else self._hold_scene(scene, number)
            if fence is None:
                busy.add(scene)
                continue
            taken = self._take(number, worker, fence)
            if taken is not None:
                return OperationLease(_load(taken), worker, fence)
            self._free_scene(scene, number, fence)
        return None

    def heartbeat_operation(self, lease: OperationLease, stage: Message, done: int, total: int) -> bool:
        progress = {"$set": {"stage": dump_text(stage), "done": done, "total": total}}
        running = {**_place(lease), "state": _RUNNING}
        return self._renew(lease) and bool(self._update_many(running, progress, "operation")) and not self._operation(_number(lease))["cancelling"]

    def append_log(self, lease: OperationLease, lines: Sequence[Message]) -> None:
        """Reserves the numbers of the lines first; a kill before they are stored leaves a gap."""
        texts, call, number = rules.log_texts(lines), new_call(), _number(lease)
        operations, half = self._connection.collection("operation"), rules.MAX_LOG_LINES // 2
        change = {"$inc": {"lines": len(texts)}, "$set": {"log_call": call}}

        def reserve(repeated: bool) -> Document | None:
            if repeated and (mine := operations.find_one({"_id": number, "log_call": call})):
                return mine
            running = {**_place(lease), "state": _RUNNING}
            return operations.find_one_and_update(running, change, return_document=ReturnDocument.AFTER)

        reserved = self._connection.run(reserve)
        if reserved is None:
            raise _stale(lease)
        now = self._connection.run(lambda _: self._connection.clock())
        numbered = list(enumerate(texts, reserved["lines"] - len(texts) + 1))
        writes = [ReplaceOne({"_id": _line_id(number, line)}, {"number": line, "time": now, "text": text}, upsert=True) for line, text in numbered]
        log = self._connection.collection("operation_log")
        if writes:
            self._connection.run(lambda _: log.bulk_write(writes))
        middle = {"_id": {"$gt": _line_id(number, half), "$lte": _line_id(number, max(reserved["lines"] - half, half))}}
        self._connection.run(lambda _: log.delete_many(middle))

    def operation_log(self, id: str, after: int = 0, limit: int = LOG_PAGE) -> list[LogLine]:
        number = self._operation(rules.operation_number(id))["_id"]
        found = self._find("operation_log", {"_id": {"$gt": _line_id(number, after), "$lt": _end_of_log(number)}}, limit=limit)
        return rules.with_gaps(
            [LogLine(document["number"], document["time"], load_text(document["text"]) or verbatim("")) for document in found], after
        )

    def end_operation(self, lease: OperationLease, state: OperationState, message: Message | None = None) -> None:
        """Frees the scene last; after a kill before that, it is free when the lease is overdue."""
        change = {"$set": {"state": OperationState(state), "message": dump_text(message), "worker": None, "cancelling": False}, **_ENDED_NOW}
        ended = self._renew(lease) and self._update_many({**_place(lease), "state": _RUNNING}, change, "operation")
        if not ended and not self._find("operation", {**_place(lease), "state": OperationState(state)}):
            raise _stale(lease)
        self._free_scene(lease.operation.scene, _number(lease), lease.fence)

    def release_operation(self, lease: OperationLease) -> None:
        if not self._renew(lease):
            raise _stale(lease)
        running = {**_place(lease), "state": _RUNNING}
        self._end_cancelled(running)
        self._update_many(running | {"cancelling": False}, {"$set": {"state": _WAITING, "worker": None}}, "operation")
        self._free_scene(lease.operation.scene, _number(lease), lease.fence)

    def expire_operations(self, workers: Iterable[str]) -> int:
        found = self._find("operation", {"state": _RUNNING, "worker": {"$in": sorted(set(workers))}})
        expired = 0
        for document in found:
            expired += self._expire_operation(document)
            self._free_scene(document["scene"], document["_id"], document["fence"])
        return expired

    # -- the scene --------------------------------------------------------------------------------------------------------------

    def _hold_scene(self, scene: str, number: int) -> int | None:
        """Claims the scene for an operation; returns the fence, None while another lease is not overdue."""
        if not self._find("operation_lock", {"_id": scene}):
            self._connection.insert("operation_lock", {"_id": scene, "holder": None, "fence": 0, "call": new_call()})
        call, locks = new_call(), self._connection.collection("operation_lock")
        change = {
            "$set": {"holder": number, "lease_ms": int(self.lease_s * 1000), "call": call},
            "$inc": {"fence": 1},
            "$currentDate": {"renewed": True},
        }

        def act(repeated: bool) -> Document | None:
            held = locks.find_one({"_id": scene, "call": call}) if repeated else None
            for condition in ({"holder": None}, OVERDUE):
                held = held or locks.find_one_and_update({"_id": scene, **condition}, change, return_document=ReturnDocument.AFTER)
            return held

        held = self._connection.run(act)
        return None if held is None else int(held["fence"])

    def _renew(self, lease: OperationLease) -> bool:
        """Renews the claim on the scene; returns whether it is still held."""
        held = {"_id": lease.operation.scene, "holder": _number(lease), "fence": lease.fence, **HELD}
        change = {"$set": {"lease_ms": int(self.lease_s * 1000)}, "$currentDate": {"renewed": True}}
        return bool(self._update_many(held, change, "operation_lock"))

    def _free_scene(self, scene: str, number: int, fence: int) -> None:
        self._update_many({"_id": scene, "holder": number, "fence": fence}, {"$set": {"holder": None}}, "operation_lock")

    # -- one operation ----------------------------------------------------------------------------------------------------------

    def _take(self, number: int, worker: str, fence: int) -> Document | None:
        """Makes a waiting operation run, one whose lease was overdue included. The caller holds the scene with `fence`."""
        before = self._find("operation", {"_id": number})
        if not before:
            return None
        if before[0]["state"] == _RUNNING:
            self._expire_operation(before[0])
        change: Document = {"$set": {"state": _RUNNING, "worker": worker, "fence": fence}}
        if before[0]["started"] is None:
            change["$currentDate"] = {"started": True}
        taken = self._update_many({"_id": number, "state": _WAITING, "fence": {"$lt": fence}}, change, "operation")
        return self._operation(number) if taken else None

    def _expire_operation(self, document: Document) -> int:
        """Ends a cancelled operation and makes any other wait again, unless its lease has changed; returns 1 when it did."""
        running = {"_id": document["_id"], "state": _RUNNING, "fence": document["fence"]}
        if self._end_cancelled(running):
            return 1
        expiries = document["expiries"] + 1
        change: Document = {"$set": {"state": _WAITING, "worker": None, "expiries": expiries}}
        if expiries >= MAX_EXPIRIES:
            change = {"$set": {**change["$set"], "state": OperationState.FAILED, "message": rules.expiry_message(expiries)}, **_ENDED_NOW}
        return self._update_many(running | {"cancelling": False}, change, "operation")

    def _end_cancelled(self, running: Document) -> int:
        change = {"state": OperationState.CANCELLED, "message": rules.CANCELLED_MESSAGE, "worker": None, "cancelling": False}
        return self._update_many(running | {"cancelling": True}, {"$set": change, **_ENDED_NOW}, "operation")

    def _operation(self, number: int) -> Document:
        found = self._find("operation", {"_id": number})
        if not found:
            raise NotFound(f"no operation {str(number)!r}; map3d operations lists them")
        return found[0]

    def _scene_of(self, new: NewOperation) -> str:
        """Returns the scene of the target. Raises NotFound."""
        collection = "rendering" if new.is_on_rendering else "scene"
        found = self._find(collection, {"_id": new.target})
        if not found:
            raise NotFound(f"no {collection} {new.target!r}")
        return str(found[0]["scene"] if new.is_on_rendering else new.target)

    def _next_number(self) -> int:
        """Returns the next operation number. A lost response skips a number."""
        counters = self._connection.collection("counter")
        change = {"$inc": {"last": 1}}
        counted = self._connection.run(
            lambda _: counters.find_one_and_update({"_id": "operation"}, change, upsert=True, return_document=ReturnDocument.AFTER)
        )
        return int(counted["last"])

    def _prune(self) -> None:
        """Removes all but the newest ended operations, and their logs before them."""
        find = self._connection.collection("operation").find
        query = {"state": {"$in": list(ENDED)}}
        old = self._connection.run(lambda _: list(find(query, {"_id": 1}).sort("_id", -1).skip(rules.MAX_ENDED)))
        for number in (document["_id"] for document in old):
            self._delete("operation_log", {"_id": {"$gt": _line_id(number, 0), "$lt": _end_of_log(number)}})
            self._delete("operation", {"_id": number})

    def _delete(self, collection: str, query: Document) -> None:
        self._connection.run(lambda _: self._connection.collection(collection).delete_many(query))


def _load(document: Document) -> OperationRecord:
    names = ("kind", "target", "scene", "done", "total", "asked_by", "created", "started", "ended", "worker", "cancelling")
    return OperationRecord(
        id=str(document["_id"]),
        arguments=json.loads(document["arguments"]),
        state=OperationState(document["state"]),
        stage=load_text(document["stage"]),
        message=load_text(document["message"]),
        **{name: document[name] for name in names},
    )


def _number(lease: OperationLease) -> int:
    return int(lease.operation.id)


def _place(lease: OperationLease) -> Document:
    return {"_id": _number(lease), "fence": lease.fence}


def _held(document: Document) -> Document:
    return {"_id": document["scene"], "holder": document["_id"], "fence": document["fence"]}


def _line_id(number: int, line: int) -> str:
    """Returns an id whose order is that of operation and line. A space sorts before "!"."""
    return f"{number:015} {line:09}"


def _end_of_log(number: int) -> str:
    return f"{number:015}!"


def _stale(lease: OperationLease) -> StaleFence:
    return StaleFence(f"operation {lease.operation.id}: the lease of {lease.worker} (fence {lease.fence}) is no longer held")
