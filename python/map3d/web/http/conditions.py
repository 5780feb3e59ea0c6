"""Conditional requests and ranges (RFC 9110)."""

import re
from typing import Final

from starlette.exceptions import HTTPException

from map3d.web.http.asgi import Headers

CONDITIONS: Final = frozenset((b"if-none-match", b"range"))
_RANGE: Final = re.compile(rb"bytes=([0-9]{0,15})-([0-9]{0,15})")


def header(headers: Headers, name: bytes) -> bytes:
    """Returns the values of a header, separated by commas; empty without it."""
    return b",".join(value for key, value in headers if key == name)


def etag_matches(if_none_match: bytes, etag: bytes) -> bool:
    """Returns whether the client has the answer: weak comparison, §13.1.2."""
    if not etag:
        return False
    tags = [tag.strip().removeprefix(b"W/") for tag in if_none_match.split(b",")]
    return b"*" in tags or etag.removeprefix(b"W/") in tags


def without_body(headers: Headers) -> Headers:
    """Returns the headers of an answer 304."""
    return [pair for pair in headers if pair[0] not in (b"content-length", b"content-type")]


def find_range(headers: Headers, etag: bytes, size: int) -> tuple[int, int] | None:
    """Returns the first byte that a GET asks for, and the one after the last (§13.1.5, §14.2); None for the whole, also where several ranges are
    asked for. Raises HTTPException 416 for a range outside."""
    found = _RANGE.fullmatch(header(headers, b"range"))
    if found is None or header(headers, b"if-range") not in (b"", etag):
        return None
    first, last = int(found[1] or -1), int(found[2] or -1)
    start, stop = (max(size - last, 0), size) if first < 0 else (first, min(last, size - 1) + 1 if last >= 0 else size)
    if (first < 0 and last < 0) or 0 <= last < first:
        return None
    if start >= size or start >= stop:
        raise HTTPException(416, "the range begins behind the end", {"Content-Range": f"bytes */{size}"})
    return start, stop


def range_headers(headers: Headers, start: int, stop: int, size: int) -> Headers:
    """Returns the headers of an answer 206, from those of the whole."""
    head = [(b"content-range", b"bytes %d-%d/%d" % (start, stop - 1, size)), (b"content-length", b"%d" % (stop - start))]
    return [pair for pair in headers if pair[0] != b"content-length"] + head
