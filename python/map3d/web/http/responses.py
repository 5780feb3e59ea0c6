"""Responses: JSON, documents that clients revalidate, files, redirects; compression."""

import gzip
import json
import os
from collections.abc import Mapping
from functools import lru_cache
from hashlib import sha256
from mimetypes import guess_type
from pathlib import Path
from typing import Any, Final

from starlette.responses import Response

from map3d.errors import NotFound
from map3d.web.http.accepting import accepts_gzip
from map3d.web.http.conditions import etag_matches, find_range, range_headers, without_body
from map3d.web.http.current import request

MIN_BYTES: Final = 1024
_TEXT_TYPES: Final = ("text/", "application/json", "application/javascript", "image/svg+xml")


def uncached(content: str | bytes = b"", status: int = 200, media_type: str = "text/html", headers: Mapping[str, str] | None = None) -> Response:
    """Returns a response that is never cached."""
    return Response(content, status, {"Cache-Control": "no-store", **(headers or {})}, media_type)


def json_value(value: Any, status: int = 200, headers: Mapping[str, str] | None = None) -> Response:
    """Returns a JSON value that is never cached."""
    return uncached(json.dumps(value, sort_keys=True, separators=(",", ":")) + "\n", status, "application/json", headers)


def redirect(location: str, status: int = 303) -> Response:
    """`location`: relative to the current page."""
    return uncached(status=status, media_type="text/plain", headers={"Location": location})


def document(data: bytes, media_type: str, headers: Mapping[str, str] | None = None) -> Response:
    """Returns the document with an ETag that clients revalidate on each request; text is compressed if the client accepts it."""
    is_text = media_type.startswith(_TEXT_TYPES)
    return revalidated(data, media_type, f'{"W/" if is_text else ""}"{sha256(data).hexdigest()[:32]}"', headers)


def revalidated(data: bytes, media_type: str, etag: str, headers: Mapping[str, str] | None = None) -> Response:
    """Returns the document, or that the client has it already."""
    response = Response(data, 200, {"ETag": etag, "Cache-Control": "no-cache", **(headers or {})}, media_type)
    if not is_known(etag):
        return compress(response)
    response.status_code, response.body, response.raw_headers = 304, b"", without_body(response.raw_headers)
    return response


def is_known(etag: str) -> bool:
    """Returns whether the client of the current request has the answer of this ETag."""
    return etag_matches(request().headers.get("if-none-match", "").encode("latin-1"), etag.encode())


def file_response(folder: Path, name: str, max_age_s: int = 0) -> Response:
    """Returns a file in the folder, or a range of it. Raises NotFound."""
    data = _read_file(folder, name)
    media_type = guess_type(name)[0] or "application/octet-stream"
    caching = f"public, max-age={max_age_s}" if max_age_s else "no-cache"
    response = document(data, media_type, {"Cache-Control": caching, "Accept-Ranges": "bytes"})
    if response.status_code == 200 and request()["method"] == "GET":
        found = find_range(request().headers.raw, response.headers["etag"].encode(), len(data))
        if found is not None:
            kept = [pair for pair in response.raw_headers if pair[0] != b"content-encoding"]
            response.status_code, response.body, response.raw_headers = 206, data[slice(*found)], range_headers(kept, *found, len(data))
    return response


def _read_file(folder: Path, name: str) -> bytes:
    """Raises NotFound for a file that is not in the folder."""
    path = folder / name
    if "\0" in name or "\\" in name or not path.resolve().is_relative_to(folder.resolve()) or not os.path.isfile(path):
        raise NotFound(f"no file {name[:64]!r}")
    return path.read_bytes()


def compress(response: Response) -> Response:
    """Compresses the response if it is text of at least MIN_BYTES and the client accepts gzip."""
    if not response.headers.get("content-type", "").startswith(_TEXT_TYPES):
        return response
    response.headers["Vary"] = "Accept-Encoding"
    if len(response.body) >= MIN_BYTES and accepts_gzip(request().headers.get("accept-encoding", "")):
        response.body = gzip_bytes(bytes(response.body))
        response.headers["Content-Encoding"] = "gzip"
        response.headers["Content-Length"] = str(len(response.body))
    return response


@lru_cache(maxsize=32)
def gzip_bytes(data: bytes) -> bytes:
    return gzip.compress(data, compresslevel=6, mtime=0)
