"""What clients accept, from their headers."""

import re
from functools import lru_cache


@lru_cache(maxsize=256)
def accepted(header: str) -> dict[str, float]:
    """Returns the names in a header of the form `a, b;q=0.5` in lower case with their weights, those wanted most first. A malformed weight is 0."""
    found = {}
    for part in header.lower().split(","):
        name, *parameters = (piece.strip() for piece in part.split(";"))
        if name:
            found[name] = next((_weight(one[2:]) for one in parameters if one.startswith("q=")), 1.0)
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def _weight(text: str) -> float:
    return float(text) if re.fullmatch(r"[01](\.[0-9]{0,3})?", text, re.ASCII) else 0.0


@lru_cache(maxsize=256)
def accepts_gzip(header: str) -> bool:
    weights = accepted(header)
    return weights.get("gzip", weights.get("*", 0.0)) > 0


def prefers_html(header: str) -> bool:
    """Returns whether the client prefers HTML to plain text and JSON, as browsers' page loads do."""
    weights = accepted(header)
    return weights.get("text/html", 0.0) > max(weights.get(name, 0.0) for name in ("text/plain", "application/json"))
