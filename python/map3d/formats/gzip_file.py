"""Documents packed with gzip, such as town.gml.gz. The core unpacks them as it reads, so that nothing is written to disk."""

import gzip
import zlib
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Final

from map3d.errors import LimitExceeded
from map3d.formats.archive_limits import ArchiveLimits

_SIGNATURE: Final = b"\x1f\x8b"
_PART_BYTES: Final = 1 << 20
_DAMAGE: Final = (EOFError, zlib.error, gzip.BadGzipFile)
_LIMITS: Final = ArchiveLimits()


def is_gzip(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(_SIGNATURE)) == _SIGNATURE


def unpacked_path(path: Path) -> Path:
    """Returns the path without the suffix .gz."""
    return path.with_suffix("") if path.suffix.lower() == ".gz" else path


def unpacked_head(path: Path, size: int) -> bytes:
    """Returns the first bytes of the content; of a damaged file, those before the damage."""
    head = b""
    for part in _parts(path, min(size, _PART_BYTES)):
        head += part
        if len(head) >= size:
            break
    return head[:size]


def content_bytes(path: Path) -> int:
    """Returns the size of a file or, if it is packed, of its content. Raises LimitExceeded if it unpacks beyond the limits of zip_archive."""
    status = path.stat()
    return _count_bytes(path, status.st_mtime_ns, status.st_size) if is_gzip(path) else status.st_size


@lru_cache(maxsize=256)
def _count_bytes(path: Path, _mtime_ns: int, _size: int) -> int:
    return sum(map(len, _parts(path, _PART_BYTES)))


def content_windows(path: Path, overlap: int) -> Iterator[bytes]:
    """Yields the content of a packed file in pieces of whole lines, if it has lines. Each repeats at least `overlap` bytes of the one before.
    Raises LimitExceeded like `content_bytes`."""
    window, repeated = bytearray(), 0
    for part in _parts(path, _PART_BYTES):
        window += part
        if len(window) < repeated + _PART_BYTES:
            continue
        end = window.rfind(b"\n") + 1 or len(window)
        yield bytes(window[:end])
        line = window.rfind(b"\n", 0, max(0, end - overlap)) + 1
        del window[: max(line, end - 2 * overlap)]
        repeated = len(window)
    yield bytes(window)


def content_parts(path: Path) -> Iterator[bytes]:
    """Yields the content of a packed file up to its end or the damage. Raises LimitExceeded like `content_bytes`."""
    yield from _parts(path, _PART_BYTES)


def _parts(path: Path, size: int) -> Iterator[bytes]:
    count, packed = 0, path.stat().st_size
    with path.open("rb") as file, gzip.GzipFile(fileobj=file) as content:
        while part := _read(content, size):
            count += len(part)
            if count > _LIMITS.bytes:
                raise LimitExceeded(f"{path}: unpacks to more than {_LIMITS.bytes:,} bytes; divide it")
            if count > _LIMITS.ratio_from_bytes and count > _LIMITS.ratio * packed:
                raise LimitExceeded(f"{path}: grows to more than {_LIMITS.ratio} times its packed size; unpack it first")
            yield part


def _read(content: gzip.GzipFile, size: int) -> bytes:
    try:
        return content.read1(size)
    except _DAMAGE:
        return b""
