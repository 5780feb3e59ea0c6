"""Finds out whether an object store heeds the conditions of writes, on which the order of workers rests."""

from contextlib import suppress
from typing import Any, Final
from uuid import uuid4

from map3d.errors import ObjectChanged, StoreError
from map3d.object_store.contract import ObjectStore
from map3d.object_store.folder import FolderStore

_PROBE: Final = "probe-"
"""Beginning of the name of an object that exists for a moment."""


def check_conditional_writes(objects: ObjectStore) -> None:
    """Raises StoreError for a store that accepts a write whose condition (If-None-Match, If-Match) does not hold. Folders are not probed."""
    if isinstance(objects, FolderStore):
        return
    name = f"{_PROBE}{uuid4().hex}"
    try:
        first = objects.put(name, b"1", if_absent=True)
        objects.put(name, b"2")
        unmet: tuple[tuple[str, dict[str, Any]], ...] = (("If-None-Match", {"if_absent": True}), ("If-Match", {"if_match": first}))
        for condition, options in unmet:
            with suppress(ObjectChanged):
                objects.put(name, b"3", **options)
                raise StoreError(
                    f"{objects.url}: the object store ignores the condition {condition} of writes, so two workers could overwrite each other "
                    "unnoticed; use S3, Google Cloud Storage, Azure or a server that heeds it, such as MinIO (docs/stores.md)"
                )
    finally:
        objects.delete(name)
