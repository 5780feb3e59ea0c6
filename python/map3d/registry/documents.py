"""Names and bytes of the documents beside the manifest (spec/manifest.md)."""

import json
from collections.abc import Mapping
from typing import Any, Final

SHARDS: Final = "objects/{shard}.json"
SEARCH: Final = "objects/search.json"
SEARCH_PAGES: Final = "objects/search/{page}.json"
ATTRIBUTES: Final = "objects/attributes.json"
COLUMNS: Final = "objects/columns/{column}.json"
COLUMN_SHARDS: Final = "objects/columns/{column}/{shard}.json"

Document = tuple[str, bytes]
"""Path below the manifest's folder, and content."""


def dump_document(document: Mapping[str, Any]) -> bytes:
    """Serializes a document beside the manifest: compact UTF-8 JSON with a final newline. Raises ValueError for NaN and infinities."""
    return (dump_json(document) + "\n").encode()


def dump_json(value: Any) -> str:
    """Returns compact JSON. Raises ValueError for NaN and infinities."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
