"""The implementations of the catalogue, and a rendering to store in them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import pytest
from pymongo import MongoClient
from pymongo.errors import AutoReconnect

from map3d.catalogue import RenderingRecord, mongodb_connection
from map3d.catalogue.mongodb_connection import MongoConnection
from map3d.geometry.frames import pin
from map3d.types import Layer, ViewAngles

LEASE_S = 1.0
BOX = ((0.0, 0.0, 0.0), (100.0, 100.0, 10.0))


IMPLEMENTATIONS = ("mongodb", "mongodb-lost-answers", "sqlite")
"""The second is a MongoDB whose first answer to every request is lost, so that every request is executed twice."""
NewUrl = Callable[[], str]


@contextmanager
def new_urls(implementation: str, request: pytest.FixtureRequest, folder: Path) -> Iterator[NewUrl]:
    """Gives a function that returns the URL of another empty catalogue at each call."""
    if implementation == "sqlite":
        yield lambda: f"sqlite://{folder / uuid4().hex}.sqlite"
        return
    if implementation == "mongodb-lost-answers":
        lose_answers(request.getfixturevalue("monkeypatch"))
    server, names = request.getfixturevalue("mongo_server"), list[str]()

    def new_url() -> str:
        names.append(f"test_{uuid4().hex[:12]}")
        return f"{server}/{names[-1]}"

    yield new_url
    with MongoClient[dict[str, object]](server) as client:
        for name in names:
            client.drop_database(name)


def lose_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    run = MongoConnection.run

    def run_twice(self: MongoConnection, action: Callable[[bool], object], retry_s: float | None = None) -> object:
        def act(repeated: bool) -> object:
            answer = action(repeated)
            if not repeated:
                raise AutoReconnect("the answer was lost")
            return answer

        return run(self, act, retry_s)

    monkeypatch.setattr(MongoConnection, "run", run_twice)
    monkeypatch.setattr(mongodb_connection, "_PAUSES_S", (0.0, 0.0))


class Kill:
    """Replaces `MongoConnection.run`: raises KeyboardInterrupt at request `number`, before or after it is executed."""

    def __init__(self, number: int, executed: bool) -> None:
        self.remaining, self.executed, self.happened = number, executed, False

    def run(self, action: Callable[[bool], object]) -> object:
        self.remaining -= 1
        if self.remaining >= 0:
            return action(False)
        self.happened = True
        if self.executed:
            action(False)
        raise KeyboardInterrupt


def rendering(name: str = "town-a") -> RenderingRecord:
    frames = tuple(pin(BOX, 256, 0.01, [ViewAngles(0, 45)]))
    return RenderingRecord(name, "town", 0.01, ((Layer("color", "color", "webp", 80), Layer("id", "id", "png")),), frames, BOX)
