"""Quantities as text: counts, sizes, durations, lists of names."""

import re
from collections.abc import Sequence
from typing import Final

_UNITS: Final = {"": 1, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30, "t": 1 << 40}


def plural(count: int, noun: str) -> str:
    """Returns the count with its noun: `1 file`, `2 files`."""
    return f"{count:,} {noun}" if count == 1 else f"{count:,} {noun}s"


def names_text(names: Sequence[str], limit: int = 8) -> str:
    """Returns the names as in `a, b, c and 5 more`."""
    shown, more = names[:limit], len(names) - limit
    return ", ".join(shown) + (f" and {more:,} more" if more > 0 else "")


def size_text(size: float) -> str:
    """Returns a number of bytes as in `1.4 GB`."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.0f} {unit}" if unit == "bytes" else f"{size:.1f} {unit}"
        size /= 1000
    return f"{size:.1f} TB"


def time_text(seconds: float) -> str:
    """Returns a duration as in `80 s`, `12 min`, `3.5 h`."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def parse_size(text: str) -> int | None:
    """Returns the bytes of a size such as `512M` or `2G`; None for other text."""
    match = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)\s*([kmgt]?)i?b?", text.strip().lower())
    return int(float(match[1]) * _UNITS[match[2]]) if match is not None and float(match[1]) > 0 else None
