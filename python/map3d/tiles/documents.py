"""JSON documents as clients get them: compact, the same bytes for the same content."""

import json
from collections.abc import Mapping
from typing import Any


def dump_document(document: Mapping[str, Any]) -> bytes:
    """UTF-8 with a final newline; raises ValueError on NaN and infinities, which JSON has not."""
    return (json.dumps(document, ensure_ascii=False, separators=(",", ":"), allow_nan=False) + "\n").encode()
