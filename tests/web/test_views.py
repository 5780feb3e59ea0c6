"""View functions run in threads; a connection that breaks holds none of them."""

import asyncio
from concurrent.futures import ThreadPoolExecutor

import pytest
from starlette.responses import Response

from map3d.web.http.routes import Routes
from map3d.web.server.views import Views

SCOPE = {"type": "http", "method": "GET", "path": "/", "query_string": b"", "headers": [], "scheme": "http"}
BODY = b"chunk" * 100_000
routes = Routes("test")


@routes.get("/")
def large() -> Response:
    return Response(BODY)


@routes.get("/broken")
def broken() -> Response:
    raise ZeroDivisionError


@pytest.fixture
def run(client):
    """Runs a function with views of one thread in a new event loop."""

    def run_one(use):
        async def main():
            views = Views(client.app.site, routes)
            views.threads = ThreadPoolExecutor(1)
            try:
                return await asyncio.wait_for(use(views), 60)
            finally:
                await asyncio.wait_for(asyncio.get_running_loop().run_in_executor(None, views.threads.shutdown), 60)

        return asyncio.run(main())

    return run_one


async def receive():
    return {"type": "http.request", "body": b"", "more_body": False}


async def answer(views, path="/"):
    """Returns the status and the body of a whole response."""
    sent = []

    async def send(message):
        sent.append(message)

    await views({**SCOPE, "path": path}, receive, send)
    return sent[0]["status"], b"".join(message.get("body", b"") for message in sent)


def test_a_large_response_is_sent_whole(run):
    assert run(answer) == (200, BODY)


@pytest.mark.parametrize("sent_before", [0, 1])
def test_a_failure_to_send_frees_the_thread(run, sent_before):
    async def fail_then_answer(views):
        count = 0

        async def send(_message):
            nonlocal count
            count += 1
            if count > sent_before:
                raise OSError("broken pipe")

        with pytest.raises(OSError, match="broken pipe"):
            await views({**SCOPE}, receive, send)
        return await answer(views)

    assert run(fail_then_answer) == (200, BODY)


def test_a_cancelled_request_frees_the_thread(run):
    async def cancel_then_answer(views):
        blocked = asyncio.Event()

        async def send(_message):
            blocked.set()
            await asyncio.Event().wait()

        request = asyncio.ensure_future(views({**SCOPE}, receive, send))
        await blocked.wait()
        request.cancel()
        with pytest.raises(asyncio.CancelledError):
            await request
        return await answer(views)

    assert run(cancel_then_answer) == (200, BODY)


def test_an_error_of_a_view_function_is_answered(run):
    assert run(lambda views: answer(views, "/broken")) == (500, b"internal server error; see the server log\n")
