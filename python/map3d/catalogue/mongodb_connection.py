"""The connection to a MongoDB database: durable writes, repetition after network errors, schema version, indexes."""

import os
import threading
import time
from collections.abc import Callable, Mapping
from datetime import datetime
from itertools import islice
from typing import Any, Final, TypeVar

from pymongo import MongoClient, UpdateOne, WriteConcern
from pymongo.collection import Collection
from pymongo.database import Database
from pymongo.errors import AutoReconnect, ConfigurationError, DuplicateKeyError, InvalidURI, OperationFailure, PyMongoError
from pymongo.uri_parser import parse_uri

from map3d.catalogue.catalogue_url import redact_url
from map3d.errors import BadRequest, StoreError, UnknownVersion

Document = dict[str, Any]
Result = TypeVar("Result")

VERSION: Final = 2
MIGRATED_BATCH: Final = 1_000
"""Documents that a migration changes with one request."""


def _add_ground(database: Database[Document]) -> None:
    """Gives every job a Hilbert index. The index over the former order of leases goes."""
    jobs = database["job"]
    without = jobs.find({"ground": {"$exists": False}}, {"morton": 1})
    while updates := [UpdateOne({"_id": job["_id"]}, {"$set": {"ground": job["morton"]}}) for job in islice(without, MIGRATED_BATCH)]:
        jobs.bulk_write(updates, ordered=False)
    for name, index in jobs.index_information().items():
        if [field for field, _ in index["key"]] == ["rendering", "state", "tries", "z", "track", "morton"]:
            jobs.drop_index(name)


MIGRATIONS: Final[Mapping[int, Callable[[Database[Document]], None]]] = {2: _add_ground}
"""Version → function that leads to it from the version before. It must be repeatable."""
CONNECT_S: Final = 10.0
"""How long the first connection may take."""
WAIT_S: Final = 240.0
"""How long a call may take while the server cannot be reached or does not answer. Longer than a lease, so that a restarted server costs only time."""
_NO_SUCH_COMMAND: Final = 59
_SELECTION_MS: Final = 2_000
_ATTEMPT_S: Final = 60.0
_PAUSES_S: Final = (0.05, 2.0)
"""First and longest pause between two attempts."""

_INDEXES: Final[Mapping[str, list[list[tuple[str, int]]]]] = {
    "job": [[(name, 1) for name in ("rendering", "state", "tries", "z", "ground", "track", "morton")], [("parent", 1), ("state", 1)]],
    "rendering": [[("scene", 1)]],
    "token": [[("digest", 1)], [("user", 1)]],
    "asset": [[("scene", 1), ("name", 1)]],
    "operation": [[("state", 1)]],
}


class MongoConnection:
    """One client per process; a client never crosses a fork. Safe to share between threads. Raises BadRequest for an invalid URL, StoreError when the
    server cannot be reached, UnknownVersion when a newer map3d wrote the database."""

    def __init__(self, url: str, wait_s: float = WAIT_S) -> None:
        """`wait_s`: how long a call may take while the server cannot be reached or does not answer."""
        self.name = redact_url(url)
        self._attempt_s = min(_ATTEMPT_S, wait_s / 2)
        self._retry_s = wait_s - self._attempt_s
        self._url, self._database_name = url, _database_of(url)
        self._lock = threading.Lock()
        self._clients: dict[int, MongoClient[Document]] = {}
        try:
            self.run(lambda _repeated: self._prepare(), min(CONNECT_S, self._retry_s))
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Closes the client of this process; a later call opens another one."""
        with self._lock:
            client = self._clients.pop(os.getpid(), None)
        if client is not None:
            client.close()

    def collection(self, name: str) -> Collection[Document]:
        return self._database()[name]

    def run(self, action: Callable[[bool], Result], retry_s: float | None = None) -> Result:
        """Returns the result of `action`, which is repeated after network errors. Its argument tells whether an earlier attempt may have been
        executed without an answer. Raises StoreError."""
        retry_s = self._retry_s if retry_s is None else retry_s
        deadline, pause, repeated = time.monotonic() + retry_s, _PAUSES_S[0], False
        while True:
            try:
                return action(repeated)
            except AutoReconnect as error:
                if time.monotonic() + pause > deadline:
                    raise StoreError(
                        f"{self.name}: cannot reach the MongoDB server for {retry_s:.0f} s ({_line(error)}); "
                        f"start it, or check the URL in MAP3D_CATALOGUE or workspace.json"
                    ) from None
            except PyMongoError as error:
                raise StoreError(f"{self.name}: MongoDB refused the request: {_line(error)}") from error
            time.sleep(pause)
            pause, repeated = min(2 * pause, _PAUSES_S[1]), True

    def clock(self) -> datetime:
        """Returns the server's time. The old command is for servers that do not know the new one."""
        admin = self._database().client.admin
        try:
            reply = admin.command("hello")
        except OperationFailure as error:
            if error.code != _NO_SUCH_COMMAND:
                raise
            reply = admin.command("isMaster")
        local_time: datetime = reply["localTime"]
        return local_time

    def insert(self, collection: str, document: Document) -> bool:
        """Inserts a document; returns False if its _id exists. `call` tells a repeated insertion from another caller's."""

        def act(repeated: bool) -> bool:
            try:
                self.collection(collection).insert_one(document)
            except DuplicateKeyError:
                same = {"_id": document["_id"], "call": document["call"]}
                return repeated and self.collection(collection).find_one(same) is not None
            return True

        return self.run(act)

    def _database(self) -> Database[Document]:
        with self._lock:
            client = self._clients.get(os.getpid())
            if client is None:
                client = self._clients[os.getpid()] = self._connect()
        return client.get_database(self._database_name, write_concern=WriteConcern("majority", j=True))

    def _connect(self) -> MongoClient[Document]:
        attempt_ms = int(1000 * self._attempt_s)
        try:
            return MongoClient(
                self._url,
                appname="map3d",
                tz_aware=True,
                serverSelectionTimeoutMS=min(_SELECTION_MS, attempt_ms),
                connectTimeoutMS=min(_SELECTION_MS, attempt_ms),
                socketTimeoutMS=attempt_ms,
            )
        except (InvalidURI, ConfigurationError, ValueError):
            raise _invalid(self._url) from None

    def _prepare(self) -> None:
        """Writes the schema version and the indexes of a new database, and migrates an older one."""
        meta = self.collection("meta")
        meta.update_one({"_id": "schema"}, {"$setOnInsert": {"version": VERSION}}, upsert=True)
        found = (meta.find_one({"_id": "schema"}) or {})["version"]
        steps = range(found + 1, VERSION + 1)
        if found > VERSION or any(step not in MIGRATIONS for step in steps):
            raise UnknownVersion(f"{self.name}: version {found}; this map3d reads version {VERSION}")
        for step in steps:
            MIGRATIONS[step](self._database())
            meta.update_one({"_id": "schema", "version": step - 1}, {"$set": {"version": step}})
        for name, indexes in _INDEXES.items():
            for keys in indexes:
                self.collection(name).create_index(keys)


def _database_of(url: str) -> str:
    try:
        name = parse_uri(url)["database"]
    except (PyMongoError, ValueError):
        raise _invalid(url) from None
    if not name:
        raise BadRequest(f"{redact_url(url)}: names no database; write mongodb://HOST[:PORT]/DATABASE")
    return str(name)


def _invalid(url: str) -> BadRequest:
    return BadRequest(
        f"{redact_url(url)}: is not a valid MongoDB URL; write mongodb://[USER:PASSWORD@]HOST[:PORT]/DATABASE, "
        f"with special characters of the password as %XX"
    )


def _line(error: Exception) -> str:
    """Returns the cause without the driver's description of the servers."""
    return str(error).partition(" (configured timeouts")[0].partition(", full error")[0].replace("\n", " ")[:300]
