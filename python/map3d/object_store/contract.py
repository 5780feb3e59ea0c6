"""The interface of an object store. A folder and the clouds pass the same tests (tests/test_object_store.py)."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final, Protocol

from map3d.errors import BadRequest

MAX_NAME_BYTES: Final = 900
"""S3 allows 1,024 bytes, including the prefix."""
_SEGMENT: Final = re.compile(r"[^\x00-\x1f\x7f/\\]+")


class ObjectStore(Protocol):
    """Thread-safe. `url` never contains credentials. Every failure raises StoreError with the URL of the object."""

    @property
    def url(self) -> str: ...

    def get(self, name: str) -> tuple[bytes, str] | None:
        """Returns the bytes and the entity tag of an object; None if it does not exist."""

    def get_range(self, name: str, start: int, length: int, *, if_match: str | None = None) -> bytes | None:
        """Returns exactly `length` bytes from `start`; None if the object does not exist. Raises StoreError if it is shorter, ObjectChanged if its
        entity tag is not `if_match`."""

    def get_start(self, name: str, length: int) -> tuple[bytes, str, int] | None:
        """Returns the first `length` bytes, or all of a shorter object, with its entity tag and size; None if it does not exist."""

    def entity_tag(self, name: str) -> str | None:
        """Returns the entity tag of an object, which differs for objects of other bytes; None if it does not exist."""

    def put(
        self,
        name: str,
        data: bytes | Path,
        *,
        if_absent: bool = False,
        if_match: str | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> str:
        """Writes an object atomically and durably, from memory or a file, and returns its entity tag.

        `if_absent`: only if it does not exist; `if_match`: only if this is still its entity tag; otherwise raises ObjectChanged, unless the stored
        object already has these bytes. `headers`: Content-Type, Cache-Control and others that the store sends with the object; a folder drops them.
        """

    def delete(self, name: str) -> None:
        """Deletes an object; does nothing if it does not exist."""

    def list(self, prefix: str = "") -> Iterator[tuple[str, int]]:
        """Yields name and size of every object in the folder `prefix`, and in all of its subfolders."""

    def exists(self, name: str) -> bool: ...


def check_object_name(name: str) -> str:
    """Returns a name of segments separated by "/". Raises BadRequest for a name that could leave the store."""
    parts = name.split("/")
    if len(name.encode()) > MAX_NAME_BYTES or not all(_SEGMENT.fullmatch(part) and not part.startswith(".") for part in parts):
        raise BadRequest(f"object name {name!r}: expected segments of visible characters separated by '/', none starting with '.'")
    return name
