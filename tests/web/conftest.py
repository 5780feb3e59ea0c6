import asyncio
import shutil
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import cast

import httpx
import pytest

from map3d.accounts import passwords
from map3d.catalogue import Workspace
from map3d.web.http.current import Request, Site, answering
from map3d.web.server.asgi_app import App, create_app
from tests.web.workspaces import make_workspace


@pytest.fixture(scope="module", autouse=True)
def quick_passwords() -> Iterator[None]:
    """Makes hashes of passwords in a millisecond; those of tests/accounts are the product's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(passwords, "METHOD", "scrypt:256:8:1")
        passwords._dummy_hash.cache_clear()
        yield
    passwords._dummy_hash.cache_clear()


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Workspace:
    """A workspace for read-only tests."""
    return make_workspace(tmp_path_factory.mktemp("finished") / "ws")


@pytest.fixture
def workspace(finished, tmp_path) -> Workspace:
    return Workspace(Path(shutil.copytree(finished.root, tmp_path / "ws")))


class Client:
    """Sends requests to the app without a network."""

    def __init__(self, app: App) -> None:
        self.app = app
        self._loop = asyncio.new_event_loop()
        self._transport = httpx.ASGITransport(app=app)
        self._client = httpx.AsyncClient(transport=self._transport, base_url="http://test")

    def request(self, method: str, path: str, **options) -> httpx.Response:
        return self._loop.run_until_complete(self._client.request(method, path, **options))

    def get(self, path: str, **options) -> httpx.Response:
        return self.request("GET", path, **options)

    def come_from(self, address: str) -> None:
        """Sends the next requests from this network address."""
        self._transport.client = (address, 1)

    def close(self) -> None:
        self._loop.run_until_complete(self._client.aclose())
        self._loop.run_until_complete(self.app.close())
        self._loop.run_until_complete(self._loop.shutdown_default_executor())
        self._loop.close()


def asked_of(app: App | None, headers: dict[str, str] | None = None) -> AbstractContextManager[None]:
    """Makes the current thread answer a request for the root of the app."""
    listed = [(name.encode(), value.encode()) for name, value in (headers or {}).items()]
    scope = {"type": "http", "method": "GET", "path": "/", "query_string": b"", "scheme": "http", "headers": listed}
    return answering(Request(scope, cast(Site, app and app.site)))


def asked_in(language: str) -> AbstractContextManager[None]:
    """Makes the current thread answer a request for a page in the language."""
    return asked_of(None, {"accept-language": language})


@pytest.fixture
def client(workspace) -> Iterator[Client]:
    made = Client(create_app(workspace))
    yield made
    made.close()
