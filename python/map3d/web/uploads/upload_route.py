"""Uploads by the tus protocol 1.0.0 (https://tus.io): core, creation, creation-with-upload, termination, expiration, checksum.

Plain ASGI, because an upload of many gigabytes must not hold a thread. Pieces go to the disk as they arrive; memory stays bounded.
"""

import asyncio
import base64
import binascii
import hashlib
import re
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from email.utils import formatdate
from typing import Any, Final, TypeVar

from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection
from starlette.responses import Response

from map3d.catalogue import Workspace
from map3d.errors import BadRequest
from map3d.uploads import ChecksumMismatch, Upload, Uploads, UploadWriter
from map3d.uploads.upload_limits import limits_from_environment
from map3d.web.http.access import COOKIE, CSRF_HEADER, AccessControl
from map3d.web.http.asgi import Receive, Scope, Send
from map3d.web.http.http_errors import not_allowed, plain_error

PATH: Final = "/uploads/"
VERSION: Final = "1.0.0"
EXTENSIONS: Final = "creation,creation-with-upload,termination,expiration,checksum"
ALGORITHMS: Final = ("sha1", "sha256", "md5")
CONTENT_TYPE: Final = "application/offset+octet-stream"
THREADS: Final = 8
MAX_WRITES: Final = 64
"""Pieces that one process receives at a time."""
IDLE_S: Final = 60.0
"""A connection that sends nothing for this long is closed; what arrived stays."""
BUFFER_BYTES: Final = 1 << 20
CLEAN_S: Final = 600.0
MAX_METADATA: Final = 8_192
METHODS: Final = ("OPTIONS", "POST", "HEAD", "PATCH", "DELETE")

_NUMBER: Final = re.compile(r"0|[1-9][0-9]{0,17}", re.ASCII)
COMMON: Final = {"Tus-Resumable": VERSION, "Cache-Control": "no-store", "X-Content-Type-Options": "nosniff"}

Result = TypeVar("Result")


class UploadRoute:
    """Receives uploads into the workspace. Belongs to one event loop; several processes may serve the same workspace. Every request but OPTIONS
    needs the role editor, and with a session cookie also the CSRF value in the header X-CSRF-Token."""

    def __init__(self, workspace: Workspace, access: AccessControl, in_use: Callable[[], frozenset[str]]) -> None:
        """`in_use` returns the ids of uploads that must not expire."""
        self.uploads = Uploads(workspace.root / "uploads", limits_from_environment())
        self._access, self._in_use = access, in_use
        self._threads = ThreadPoolExecutor(THREADS, thread_name_prefix="uploads")
        self._writes = 0
        self._cleaned_s = float("-inf")

    def answers(self, scope: Scope) -> bool:
        return bool(scope["path"].startswith(PATH))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            status, more = await self._answer(scope["method"], scope["path"][len(PATH) :], HTTPConnection(scope), receive)
            response = Response(status_code=status, headers={**COMMON, **more})
        except Exception as error:
            response = plain_error(error, COMMON)
        await response(scope, receive, send)

    async def close(self) -> None:
        self._threads.shutdown(cancel_futures=True)

    async def _answer(self, method: str, id: str, request: HTTPConnection, receive: Receive) -> tuple[int, dict[str, str]]:
        headers = request.headers
        if method == "OPTIONS":
            size = str(self.uploads.limits.quota_bytes)
            more = {"Tus-Version": VERSION, "Tus-Extension": EXTENSIONS, "Tus-Max-Size": size, "Tus-Checksum-Algorithm": ",".join(ALGORITHMS)}
            return 204, more
        if method == "POST" and id and "x-http-method-override" in headers:
            method = headers["x-http-method-override"].upper()
        if method not in (("POST",) if not id else ("HEAD", "PATCH", "DELETE")):
            raise not_allowed(*METHODS)
        user = await self._run(self._check, method, request)
        if headers.get("tus-resumable") != VERSION:
            raise HTTPException(412, f"the header Tus-Resumable is missing or not {VERSION}", {"Tus-Version": VERSION})
        if method == "POST":
            return await self._create(user, headers, receive)
        if method == "PATCH":
            return await self._append(user, id, headers, receive)
        if method == "DELETE":
            await self._run(self.uploads.remove, id, user)
            return 204, {}
        upload = await self._run(self.uploads.get, id, user)
        return 200, {"Upload-Offset": str(upload.offset), "Upload-Length": str(upload.size), **self._expires(upload)}

    def _check(self, method: str, request: HTTPConnection) -> str:
        """Returns the user. Raises SignInRequired, Forbidden."""
        caller = self._access.recognise(request.cookies.get(COOKIE), request.headers.get("authorization"))
        return self._access.check(caller, "editor", method, request.headers.get(CSRF_HEADER)).user

    async def _create(self, user: str, headers: Mapping[str, str], receive: Receive) -> tuple[int, dict[str, str]]:
        metadata = parse_metadata(headers.get("upload-metadata", ""))
        name = metadata.get("relativePath") or metadata.get("filename") or metadata.get("name", "")
        size = _number(headers, "upload-length")
        await self._clean()
        upload = await self._run(self.uploads.create, user, name, size, metadata.get("batch", ""))
        more = {"Location": upload.id, **self._expires(upload)}
        if headers.get("content-type") == CONTENT_TYPE and size:
            writer = await self._run(self.uploads.write, upload.id, user, 0)
            more["Upload-Offset"] = str(await self._receive(writer, headers, receive))
        return 201, more

    async def _append(self, user: str, id: str, headers: Mapping[str, str], receive: Receive) -> tuple[int, dict[str, str]]:
        if headers.get("content-type") != CONTENT_TYPE:
            raise HTTPException(415, f"the content type is not {CONTENT_TYPE}")
        writer = await self._run(self.uploads.write, id, user, _number(headers, "upload-offset"))
        offset = await self._receive(writer, headers, receive)
        return 204, {"Upload-Offset": str(offset), **self._expires(writer.upload)}

    async def _receive(self, writer: UploadWriter, headers: Mapping[str, str], receive: Receive) -> int:
        """Writes the body as it arrives; returns the new offset. Whatever arrived before the connection broke stays, unless a checksum was sent."""
        try:
            check = _checksum(headers)
            if self._writes >= MAX_WRITES:
                raise HTTPException(503, f"the server receives {MAX_WRITES} uploads already; try again", {"Retry-After": "5"})
        except BaseException:
            await self._run(writer.close)
            raise
        self._writes += 1
        try:
            complete = await self._copy(writer, check, receive)
            if check is not None and not (complete and check[0].digest() == check[1]):
                await self._run(writer.discard)
                raise ChecksumMismatch(f"upload {writer.upload.name}: the piece arrived damaged; send it again")
            if not complete:
                raise HTTPException(408, f"no data for {IDLE_S:.0f} s, or the connection broke; resume at byte {writer.offset}")
            return writer.offset
        finally:
            self._writes -= 1
            await asyncio.shield(self._run(writer.close))

    async def _copy(self, writer: UploadWriter, check: tuple[Any, bytes] | None, receive: Receive) -> bool:
        """Returns whether the whole body arrived."""
        parts, size = list[bytes](), 0
        complete = more = True
        while more:
            try:
                event = await asyncio.wait_for(receive(), IDLE_S)
            except TimeoutError:
                event = {"type": "http.disconnect"}
            complete = event["type"] == "http.request"
            more = complete and event.get("more_body", False)
            parts.append(event.get("body", b""))
            size += len(parts[-1])
            if size >= BUFFER_BYTES or not more:
                await self._run(_write, writer, check, b"".join(parts))
                parts, size = [], 0
        return complete

    async def _clean(self) -> None:
        """Removes expired uploads at most every CLEAN_S."""
        if time.monotonic() - self._cleaned_s > CLEAN_S:
            self._cleaned_s = time.monotonic()
            await self._run(lambda: self.uploads.remove_expired(self._in_use()))

    def _expires(self, upload: Upload) -> dict[str, str]:
        return {"Upload-Expires": formatdate(time.time() + self.uploads.limits.expire_s, usegmt=True)} if not upload.complete else {}

    async def _run(self, function: Callable[..., Result], *arguments: Any) -> Result:
        return await asyncio.get_running_loop().run_in_executor(self._threads, function, *arguments)


def parse_metadata(text: str) -> dict[str, str]:
    """Returns the pairs of Upload-Metadata: key, space, value in base64; separated by commas. Raises BadRequest."""
    if len(text) > MAX_METADATA:
        raise BadRequest(f"Upload-Metadata has {len(text)} bytes, at most {MAX_METADATA} are allowed")
    pairs = {}
    for pair in filter(None, (part.strip() for part in text.split(","))):
        key, _, value = pair.partition(" ")
        try:
            pairs[key] = base64.b64decode(value.strip(), validate=True).decode()
        except (binascii.Error, UnicodeDecodeError, ValueError) as error:
            raise BadRequest(f"Upload-Metadata: the value of {key[:40]!r} is not UTF-8 in base64") from error
    return pairs


def _write(writer: UploadWriter, check: tuple[Any, bytes] | None, data: bytes) -> None:
    writer.write(data)
    if check is not None:
        check[0].update(data)


def _number(headers: Mapping[str, str], name: str) -> int:
    """Raises BadRequest."""
    if not _NUMBER.fullmatch(headers.get(name, "")):
        raise BadRequest(f"the header {name.title()} is {headers.get(name, '')[:40]!r}, expected a number of bytes")
    return int(headers[name])


def _checksum(headers: Mapping[str, str]) -> tuple[Any, bytes] | None:
    """Returns a hash and the expected digest, or None if Upload-Checksum is missing. Raises BadRequest."""
    if "upload-checksum" not in headers:
        return None
    name, _, value = headers["upload-checksum"].partition(" ")
    try:
        digest = base64.b64decode(value, validate=True)
    except (binascii.Error, ValueError):
        digest = b""
    if name not in ALGORITHMS or len(digest) != hashlib.new(name, usedforsecurity=False).digest_size:
        raise BadRequest(f"Upload-Checksum: expected one of {', '.join(ALGORITHMS)}, a space and the digest in base64")
    return hashlib.new(name, usedforsecurity=False), digest
