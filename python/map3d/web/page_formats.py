"""Numbers, sizes, lengths and times as pages write them: in the language of the page, by the Unicode CLDR."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal
from typing import Any, Final, Literal

from babel.dates import format_datetime
from babel.numbers import format_decimal
from babel.units import format_unit

from map3d.web.page_language import language


@dataclass(frozen=True)
class Style:
    """`locale`, `date` and `moment`: a locale and patterns of the CLDR. `space`: what separates a number from `%`, `s`, `min` and `h`."""

    locale: str
    date: str
    moment: str
    space: str


STYLES: Final[Mapping[str, Style]] = {
    "en": Style("en_GB", "d MMMM y", "d MMMM y, HH:mm 'UTC'", " "),
    "de": Style("de", "d. MMM y", "d. MMM y, HH:mm 'UTC'", "\N{NO-BREAK SPACE}"),
    "fr": Style("fr", "d MMM y", "d MMM y, HH:mm 'UTC'", "\N{NARROW NO-BREAK SPACE}"),
}
_SIZES: Final = ("kilobyte", "megabyte", "gigabyte")


def size(value: float) -> str:
    """Returns bytes as in `1.4 GB`, with three digits."""
    if value < 999.5:
        return _unit(value, "digital-byte", 0, "long")
    for unit in _SIZES:
        value /= 1000
        if value < 999.5:
            return _unit(value, f"digital-{unit}", 0 if value >= 10 else 1)
    return _unit(value / 1000, "digital-terabyte", 1)


def duration(seconds: float) -> str:
    """Returns a time as in `80 s`, `12 min`, `3.5 h`."""
    if seconds < 90:
        return _with_space(number(max(1, round(seconds))), "s")
    return _with_space(decimal(seconds / 60, 0), "min") if seconds < 5400 else _with_space(decimal(seconds / 3600, 1), "h")


def number(value: float) -> str:
    """Returns a whole number with all digits, another one with six."""
    exact = value if isinstance(value, int) or not math.isfinite(value) else Decimal(f"{value:.6g}")
    return format_decimal(exact, locale=_style().locale, decimal_quantization=False)


def decimal(value: float, places: int) -> str:
    """Returns a number with a fixed number of decimal places."""
    return format_decimal(round(value, places), _pattern(places), locale=_style().locale)


def percent(part: int, whole: int) -> str:
    """Returns a part as in `45 %`, rounded down, so that only the whole is 100 %."""
    return _with_space(number(100 * part // whole), "%")


def metres(value: float) -> str:
    """Returns a length in metres as in `0.2 m`."""
    return _with_space(number(value), "m")


def distance(value: float) -> str:
    """Returns a length in metres as in `650 m`, `3.25 km`, `1,200 km`, with three digits."""
    if value >= 1e6:
        return _with_space(decimal(value / 1000, 0), "km")
    short = float(f"{value / 1000:.3g}") if value >= 1000 else float(f"{value:.3g}")
    return _with_space(number(short), "km" if value >= 1000 else "m")


def date(value: datetime) -> str:
    """Returns a day in UTC as in `3 May 2026`."""
    return format_datetime(value.astimezone(UTC), _style().date, locale=_style().locale)


def moment(value: datetime | float | None) -> str:
    """Returns a time as in `3 May 2026, 14:05 UTC`; the value is a datetime or seconds since 1970."""
    if value is None:
        return "–"
    time = value if isinstance(value, datetime) else datetime.fromtimestamp(value, UTC)
    return format_datetime(time.astimezone(UTC), _style().moment, locale=_style().locale)


def _style() -> Style:
    return STYLES[language()]


def _with_space(text: str, unit: str) -> str:
    return f"{text}{_style().space}{unit}"


def _unit(value: float, unit: str, places: int, length: Literal["short", "long"] = "short") -> str:
    return format_unit(round(value, places), unit, length, format=_pattern(places), locale=_style().locale)


def _pattern(places: int) -> str:
    return "#,##0" + ("." + "0" * places if places else "")


FILTERS: Final[Mapping[str, Callable[..., Any]]] = {
    "size": size,
    "duration": duration,
    "number": number,
    "percent": percent,
    "metres": metres,
    "date": date,
    "moment": moment,
}
