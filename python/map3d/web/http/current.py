"""The request that the current thread answers, and the site that it belongs to."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final
from urllib.parse import parse_qsl

from starlette.datastructures import ImmutableMultiDict, QueryParams
from starlette.requests import HTTPConnection

from map3d.accounts import Session
from map3d.catalogue import Catalogue, Workspace
from map3d.previews.preview_pool import PreviewPool
from map3d.web.http.access import COOKIE, AccessControl, Caller
from map3d.web.http.asgi import Scope
from map3d.web.http.open_stores import OpenStores
from map3d.web.http.settings import ServerSettings
from map3d.web.http.shared_catalogue import SharedCatalogue
from map3d.web.http.tiled_views import TiledViews

Fields = ImmutableMultiDict[str, str]
FORM: Final = "application/x-www-form-urlencoded"


@dataclass
class Site:
    """What the requests of a process share. Threads may share it."""

    catalogue: SharedCatalogue
    settings: ServerSettings
    access: AccessControl
    stores: OpenStores
    views: TiledViews
    previews: PreviewPool

    def close(self) -> None:
        self.previews.close()
        self.access.close()
        self.catalogue.close()


class Request(HTTPConnection):
    """A request whose body has arrived. One thread answers it."""

    new_session: Session | None = None
    """A session that the answer gives to a visitor without one."""

    def __init__(self, scope: Scope, site: Site, body: bytes = b"") -> None:
        super().__init__(scope)
        self.site, self.body = site, body

    @cached_property
    def query_params(self) -> QueryParams:
        return QueryParams(self.scope["query_string"].decode("utf-8", "replace"))

    @cached_property
    def form(self) -> Fields:
        """The fields of a form; none if the body is something else."""
        text = self.body.decode("utf-8", "replace") if self._media_type() == FORM else ""
        return ImmutableMultiDict(parse_qsl(text, keep_blank_values=True))

    def json(self) -> Any:
        """Returns the value of a JSON body, None for any other body."""
        try:
            return json.loads(self.body) if self._media_type() == "application/json" else None
        except (ValueError, RecursionError):
            return None

    @cached_property
    def caller(self) -> Caller:
        """Who sent the request."""
        return self.site.access.recognise(self.cookies.get(COOKIE), self.headers.get("authorization"))

    def _media_type(self) -> str:
        return self.headers.get("content-type", "").partition(";")[0].strip().lower()


_request: Final[ContextVar[Request]] = ContextVar("request")


@contextmanager
def answering(request: Request) -> Iterator[None]:
    """Makes the request that of the current thread."""
    token = _request.set(request)
    try:
        yield
    finally:
        _request.reset(token)


def request() -> Request:
    """Raises LookupError where no request is answered."""
    return _request.get()


def site() -> Site:
    return request().site


def workspace() -> Workspace:
    return site().catalogue.workspace


def catalogue() -> Catalogue:
    return site().catalogue()
