"""Numbers, sizes and times as pages write them."""

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any, Final


def size(value: float) -> str:
    """Returns bytes as in `1.4 GB`, with three digits."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if value < 999.5:
            return f"{value:.0f} {unit}" if value >= 10 or unit == "bytes" else f"{value:.1f} {unit}"
        value /= 1000
    return f"{value:.1f} TB"


def duration(seconds: float) -> str:
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def number(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:,.6g}"


def moment(value: datetime | float | None) -> str:
    """Returns a time as in `3 May 2026, 14:05 UTC`; the value is a datetime or seconds since 1970."""
    if value is None:
        return "–"
    time = value if isinstance(value, datetime) else datetime.fromtimestamp(value, UTC)
    return time.astimezone(UTC).strftime("%-d %B %Y, %H:%M UTC")


FILTERS: Final[dict[str, Callable[..., Any]]] = {"size": size, "duration": duration, "number": number, "moment": moment}
