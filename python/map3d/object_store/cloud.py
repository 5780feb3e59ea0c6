"""S3, Google Cloud Storage and Azure through obstore, which is installed with `map3d[cloud]`."""

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Mapping
from datetime import timedelta
from pathlib import Path
from typing import Any, Final, Self, TypeVar

from map3d.errors import BadRequest, ObjectChanged, StoreError
from map3d.object_store.contract import ObjectStore, check_object_name

try:
    import obstore
    from obstore.exceptions import AlreadyExistsError, BaseError, PermissionDeniedError, PreconditionError, UnauthenticatedError
except ImportError as error:
    raise BadRequest("object stores in the cloud need obstore; install it with: pip install 'map3d[cloud]'") from error

ATTEMPTS: Final = 6
"""Attempts of a request, beyond the retries within obstore."""
FIRST_PAUSE_S: Final = 0.1
REQUEST_TIMEOUT_S: Final = 120
"""For one request with its answer, objects of 64 MiB included."""
CONNECT_TIMEOUT_S: Final = 10
LIST_CHUNK: Final = 1000

_Answer = TypeVar("_Answer")


class CloudStore(ObjectStore):
    """A bucket or container, or a prefix in it.

    Requests that fail are repeated with growing pauses; a write whose answer was lost is checked by its bytes.
    """

    def __init__(self, url: str) -> None:
        self._url = url
        retry: Any = {"max_retries": 6, "retry_timeout": timedelta(seconds=REQUEST_TIMEOUT_S)}
        client: Any = {"timeout": timedelta(seconds=REQUEST_TIMEOUT_S), "connect_timeout": timedelta(seconds=CONNECT_TIMEOUT_S)}
        if os.environ.get("AWS_ENDPOINT_URL", "").startswith("http://"):
            client["allow_http"] = True
        try:
            self._store: Any = obstore.store.from_url(url, client_options=client, retry_config=retry)
        except (BaseError, ValueError) as error:
            raise BadRequest(f"{url}: cannot open the object store: {_first_line(error)}; check the URL and the environment") from error

    @property
    def url(self) -> str:
        return self._url

    def get(self, name: str) -> tuple[bytes, str] | None:
        def read() -> tuple[bytes, str]:
            answer = obstore.get(self._store, check_object_name(name))
            data, meta = bytes(answer.bytes()), answer.meta
            _check_length(data, int(meta["size"]))
            return data, _tag(meta)

        return self._try(name, read)

    def get_range(self, name: str, start: int, length: int, *, if_match: str | None = None) -> bytes | None:
        options: Any = {"range": (start, start + length)} | ({} if if_match is None else {"if_match": if_match})

        def read() -> bytes:
            data = bytes(obstore.get(self._store, check_object_name(name), options=options).bytes()) if length else b""
            _check_length(data, length)
            return data

        try:
            return self._try(name, read)
        except PreconditionError as error:
            raise ObjectChanged(f"{self._url}/{name}: was replaced by another process") from error

    def get_start(self, name: str, length: int) -> tuple[bytes, str, int] | None:
        def read() -> tuple[bytes, str, int]:
            answer = obstore.get(self._store, check_object_name(name), options={"range": (0, length)})
            data, meta = bytes(answer.bytes()), answer.meta
            size = int(meta["size"])
            _check_length(data, min(length, size))
            return data, _tag(meta), size

        return self._try(name, read)

    def entity_tag(self, name: str) -> str | None:
        return self._try(name, lambda: _tag(obstore.head(self._store, check_object_name(name))))

    def exists(self, name: str) -> bool:
        return self.entity_tag(name) is not None

    def put(
        self,
        name: str,
        data: bytes | Path,
        *,
        if_absent: bool = False,
        if_match: str | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> str:
        conditional = if_absent or if_match is not None
        mode: Any = {"e_tag": if_match} if if_match is not None else "create" if if_absent else "overwrite"
        attributes: Any = dict(headers or {})
        content: Any = data.read_bytes() if conditional and isinstance(data, Path) else data

        def write() -> str | None:
            with contextlib.suppress(AlreadyExistsError, PreconditionError):
                options: dict[str, Any] = {"use_multipart": False} if conditional else {}
                return _tag(obstore.put(self._store, check_object_name(name), content, mode=mode, attributes=attributes, **options))
            return None

        tag = self._try(name, write)
        if tag is None and not conditional:
            raise StoreError(f"{self._url}: cannot write {name}: no such bucket or container")
        return tag if tag is not None else self._own_bytes(name, content)

    def delete(self, name: str) -> None:
        self._try(name, lambda: obstore.delete(self._store, check_object_name(name)))

    def list(self, prefix: str = "") -> Iterator[tuple[str, int]]:
        pages = self._pages(check_object_name(prefix) if prefix else None)
        while page := self._try(prefix, lambda: next(pages, [])):
            yield from page

    def _pages(self, prefix: str | None) -> "_Pages":
        return _Pages(lambda last: obstore.list(self._store, prefix=prefix, offset=last, chunk_size=LIST_CHUNK))

    def _own_bytes(self, name: str, data: bytes) -> str:
        """Returns the entity tag if the stored object has the same bytes; raises ObjectChanged otherwise."""
        found = self.get(name)
        if found is None or found[0] != data:
            raise ObjectChanged(f"{self._url}/{name}: was created, replaced or deleted by another process")
        return found[1]

    def _try(self, name: str, request: Callable[[], _Answer]) -> _Answer | None:
        """Repeats a failing request; returns None if the object does not exist."""
        pause_s = FIRST_PAUSE_S
        for attempt in range(1, ATTEMPTS + 1):
            try:
                return request()
            except FileNotFoundError:
                return None
            except PreconditionError:
                raise
            except (PermissionDeniedError, UnauthenticatedError) as error:
                raise StoreError(f"{self._url}: no permission for {name!r}; check the credentials in the environment (docs/stores.md)") from error
            except (BaseError, OSError, _ShortAnswer) as error:
                if attempt == ATTEMPTS:
                    raise StoreError(f"{self._url}: {name!r} failed {ATTEMPTS} times: {_first_line(error)}") from error
            time.sleep(pause_s)
            pause_s *= 2
        raise AssertionError("unreachable: the last attempt returns or raises")


class _Pages:
    """The pages of a listing: (name, size) each. After an error, the next page follows the last good one."""

    def __init__(self, list_after: Callable[[str | None], Any]) -> None:
        self._list_after = list_after
        self._last: str | None = None
        self._stream: Any = None

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> list[tuple[str, int]]:
        try:
            self._stream = self._stream or iter(self._list_after(self._last))
            page = [(str(meta["path"]), int(meta["size"])) for meta in next(self._stream)]
        except Exception:
            self._stream = None
            raise
        self._last = page[-1][0] if page else self._last
        return page


class _ShortAnswer(Exception):
    """The answer has fewer bytes than the object."""


def _check_length(data: bytes, expected: int) -> None:
    if len(data) != expected:
        raise _ShortAnswer(f"expected {expected} bytes, got {len(data)}")


def _tag(meta: Mapping[str, Any]) -> str:
    """Returns the entity tag; raises StoreError for a store without any."""
    tag = meta.get("e_tag")
    if not isinstance(tag, str) or not tag:
        raise StoreError("the object store returns no entity tags (ETag), which map3d needs for safe writes")
    return tag


def _first_line(error: BaseException) -> str:
    """Returns the cause without the details that follow, which contain addresses and headers."""
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
