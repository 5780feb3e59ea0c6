"""Requests while the queue of computations is full."""

import threading
from collections.abc import Iterator
from concurrent.futures import Future

import pytest

from map3d.portrayal import request_readers
from map3d.portrayal.answers import Answer
from map3d.portrayal.request_readers import MOST_WAITING, THREADS, RequestReaders
from map3d.portrayal.service import PortrayalService, ServiceRequest
from map3d.portrayal.service_exception import busy
from map3d.subprocess import Message
from tests.portrayal.conftest import ENDPOINT, Ask
from tests.portrayal.queries import ORTHOGRAPHIC, PERSPECTIVE, get_view

LIMIT_S = 60


def view(height: int, spelling: str = "") -> str:
    return get_view(height=height, projection=PERSPECTIVE, more=spelling)


@pytest.fixture
def full() -> threading.Event:
    return threading.Event()


@pytest.fixture
def readers(full: threading.Event) -> Iterator[RequestReaders]:
    made = RequestReaders(full.is_set)
    yield made
    made.close()


def test_several_requests_are_read_at_a_time(readers: RequestReaders) -> None:
    together = threading.Barrier(THREADS + 1)
    for _ in range(THREADS):
        assert readers.submit(b"a", lambda: together.wait(LIMIT_S))
    together.wait(LIMIT_S)


def test_requests_are_read_one_at_a_time_while_the_queue_is_full(readers: RequestReaders, full: threading.Event) -> None:
    full.set()
    reading, most, done = [0], [0], threading.Semaphore(0)

    def read() -> None:
        reading[0] += 1
        most[0] = max(most[0], reading[0])
        threading.Event().wait(0.01)
        reading[0] -= 1
        done.release()

    for _ in range(MOST_WAITING):
        assert readers.submit(b"a", read)
    for _ in range(MOST_WAITING):
        assert done.acquire(timeout=LIMIT_S)
    assert most == [1]


def test_further_requests_are_refused_unless_they_were_answered_before(readers: RequestReaders, full: threading.Event) -> None:
    full.set()
    ended, read = threading.Event(), threading.Semaphore(0)
    readers.remember(b"known")
    assert readers.submit(b"first", lambda: ended.wait(LIMIT_S) and read.release())
    for _ in range(MOST_WAITING - 1):
        assert readers.submit(b"other", read.release)
    assert not readers.submit(b"other", read.release)
    assert readers.submit(b"known", read.release)
    full.clear()
    assert readers.submit(b"other", read.release), "the queue has places again"
    ended.set()
    for _ in range(MOST_WAITING + 2):
        assert read.acquire(timeout=LIMIT_S)


def test_the_oldest_requests_are_forgotten(readers: RequestReaders, full: threading.Event, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(request_readers, "REMEMBERED", 2)
    monkeypatch.setattr(request_readers, "MOST_WAITING", 0)
    for request in (b"a", b"b", b"a", b"c"):
        readers.remember(request)
    full.set()
    assert [readers.submit(request, lambda: None) for request in (b"a", b"b", b"c")] == [True, False, True]


@pytest.fixture
def held(service: PortrayalService, monkeypatch: pytest.MonkeyPatch) -> Iterator["Future[Answer]"]:
    """A service with one place for computations and one stored view. The place is taken until the test ends."""
    first = service.answer(request_of(view(100)))
    assert first.status == 200
    started: threading.Event = threading.Event()
    traced: Future[Message] = Future()

    def submit(_scene: str, _request: object) -> "Future[Message]":
        started.set()
        return traced

    monkeypatch.setattr(service.pool, "submit", submit)
    monkeypatch.setattr(service, "_limit", 1)
    waiting = service.submit(request_of(view(101)))
    assert started.wait(LIMIT_S)
    yield waiting
    traced.set_exception(busy("the test ends"))
    assert waiting.result(LIMIT_S).status == 503


def request_of(query: str) -> ServiceRequest:
    return ServiceRequest(f"service=3DPS&version=1.0&{query}".encode(), None, ENDPOINT)


def test_a_full_queue_answers_what_is_stored(ask: Ask, service: PortrayalService, held: "Future[Answer]") -> None:
    refused = ask(view(102))
    assert (refused.status, refused.headers["Retry-After"]) == (503, "5")
    assert [ask(view(100)).status, ask(view(100, "&styles=textured")).status] == [200, 200]
    assert ask(view(-1)).status == 400
    assert ask("request=GetCapabilities").status == 200
    assert service.views.computed == [2]
    assert not held.done()


def test_a_request_that_is_refused_unread_says_when_to_ask_again(
    ask: Ask, held: "Future[Answer]", service: PortrayalService, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(request_readers, "MOST_WAITING", 0)
    for query in (view(102), view(-1), get_view(projection=ORTHOGRAPHIC)):
        refused = ask(query)
        assert (refused.status, refused.media_type, refused.headers["Retry-After"]) == (503, "text/xml", "5")
        assert refused.headers["Cache-Control"] == "no-store"
    assert ask(view(100)).status == 200, "answered before"
    assert not held.done()
