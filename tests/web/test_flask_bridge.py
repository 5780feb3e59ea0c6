"""A thread of the bridge to Flask never waits for a response that is never sent."""

import asyncio

import pytest

from map3d.web.server.flask_bridge import FlaskBridge

CHUNKS = 50
SCOPE = {
    "type": "http", "method": "GET", "path": "/", "query_string": b"", "http_version": "1.1", "headers": [], "server": ("x", 80), "client": ("x", 1),
}  # fmt: skip


class Application:
    """A WSGI application whose response has many chunks."""

    def __init__(self):
        self.closed = 0

    def __call__(self, _environ, start_response):
        start_response("200 OK", [("Content-Type", "text/plain")])
        return self

    def __iter__(self):
        return iter([b"chunk"] * CHUNKS)

    def close(self):
        self.closed += 1


@pytest.fixture
def application():
    return Application()


@pytest.fixture
def run(application):
    """Runs a function with a bridge of one thread in a new event loop."""

    def run_one(use):
        async def main():
            bridge = FlaskBridge(application, workers=1)
            try:
                return await asyncio.wait_for(use(bridge), 60)
            finally:
                await asyncio.wait_for(asyncio.get_running_loop().run_in_executor(None, bridge.executor.shutdown), 60)

        return asyncio.run(main())

    return run_one


async def receive():
    return {"type": "http.request", "body": b"", "more_body": False}


async def answer(bridge):
    """Returns the body of a whole response."""
    sent = []

    async def send(message):
        sent.append(message)

    await bridge(SCOPE, receive, send)
    assert sent[0]["status"] == 200
    return b"".join(message.get("body", b"") for message in sent)


def test_a_response_of_many_chunks_is_sent_whole(run, application):
    assert run(answer) == b"chunk" * CHUNKS
    assert application.closed == 1


@pytest.mark.parametrize("sent_before", [0, 1, 2, 20, CHUNKS])
def test_a_failure_to_send_frees_the_thread(run, application, sent_before):
    async def fail_then_answer(bridge):
        count = 0

        async def send(_message):
            nonlocal count
            count += 1
            if count > sent_before:
                raise OSError("broken pipe")

        with pytest.raises(OSError, match="broken pipe"):
            await bridge(SCOPE, receive, send)
        return await answer(bridge)

    assert run(fail_then_answer) == b"chunk" * CHUNKS
    assert application.closed == 2


def test_a_cancelled_request_frees_the_thread(run, application):
    async def cancel_then_answer(bridge):
        blocked = asyncio.Event()

        async def send(_message):
            blocked.set()
            await asyncio.Event().wait()

        request = asyncio.ensure_future(bridge(SCOPE, receive, send))
        await blocked.wait()
        request.cancel()
        with pytest.raises(asyncio.CancelledError):
            await request
        return await answer(bridge)

    assert run(cancel_then_answer) == b"chunk" * CHUNKS
    assert application.closed == 2


def test_an_error_of_the_application_is_raised(run):
    async def break_down(bridge):
        def broken(_environ, _start_response):
            raise ZeroDivisionError

        bridge.app = broken
        with pytest.raises(ZeroDivisionError):
            await bridge(SCOPE, receive, receive)
        return True

    assert run(break_down)
