"""Numbers, sizes, lengths and times in English, German and French, by the Unicode CLDR."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal
from typing import Final, Literal

from babel.dates import format_datetime
from babel.numbers import format_decimal
from babel.units import format_unit


@dataclass(frozen=True)
class LocaleFormats:
    """`locale`, `date` and `moment`: a locale and patterns of the CLDR. `space`: what separates a number from `%`, `s`, `min` and `h`."""

    locale: str
    date: str
    moment: str
    space: str


STYLES: Final[Mapping[str, LocaleFormats]] = {
    "en": LocaleFormats("en_GB", "d MMMM y", "d MMMM y, HH:mm 'UTC'", " "),
    "de": LocaleFormats("de", "d. MMM y", "d. MMM y, HH:mm 'UTC'", "\N{NO-BREAK SPACE}"),
    "fr": LocaleFormats("fr", "d MMM y", "d MMM y, HH:mm 'UTC'", "\N{NARROW NO-BREAK SPACE}"),
}
_SIZES: Final = ("kilobyte", "megabyte", "gigabyte")


def size(value: float, language: str) -> str:
    """Returns bytes as in `1.4 GB`, with three digits."""
    if value < 999.5:
        return _unit(value, "digital-byte", 0, language, "long")
    for unit in _SIZES:
        value /= 1000
        if value < 999.5:
            return _unit(value, f"digital-{unit}", 0 if value >= 10 else 1, language)
    return _unit(value / 1000, "digital-terabyte", 1, language)


def duration(seconds: float, language: str) -> str:
    """Returns a time as in `80 s`, `12 min`, `3.5 h`."""
    if seconds < 90:
        return _with_space(number(max(1, round(seconds)), language), "s", language)
    if seconds < 5400:
        return _with_space(decimal(seconds / 60, 0, language), "min", language)
    return _with_space(decimal(seconds / 3600, 1, language), "h", language)


def number(value: float, language: str) -> str:
    """Returns a whole number with all digits, another one with six."""
    exact = value if isinstance(value, int) or not math.isfinite(value) else Decimal(f"{value:.6g}")
    return format_decimal(exact, locale=STYLES[language].locale, decimal_quantization=False)


def decimal(value: float, places: int, language: str) -> str:
    """Returns a number with a fixed number of decimal places."""
    return format_decimal(round(value, places), _pattern(places), locale=STYLES[language].locale)


def percent(part: int, whole: int, language: str) -> str:
    """Returns a part as in `45 %`, rounded down, so that only the whole is 100 %."""
    return _with_space(number(100 * part // whole, language), "%", language)


def metres(value: float, language: str) -> str:
    """Returns a length in metres as in `0.2 m`."""
    return _with_space(number(value, language), "m", language)


def distance(value: float, language: str) -> str:
    """Returns a length in metres as in `650 m`, `3.25 km`, `1,200 km`, with three digits."""
    if value >= 1e6:
        return _with_space(decimal(value / 1000, 0, language), "km", language)
    short = float(f"{value / 1000:.3g}") if value >= 1000 else float(f"{value:.3g}")
    return _with_space(number(short, language), "km" if value >= 1000 else "m", language)


def date(value: datetime, language: str) -> str:
    """Returns a day in UTC as in `3 May 2026`."""
    return format_datetime(value.astimezone(UTC), STYLES[language].date, locale=STYLES[language].locale)


def moment(value: datetime | float | None, language: str) -> str:
    """Returns a time as in `3 May 2026, 14:05 UTC`; the value is a datetime or seconds since 1970."""
    if value is None:
        return "–"
    time = value if isinstance(value, datetime) else datetime.fromtimestamp(value, UTC)
    return format_datetime(time.astimezone(UTC), STYLES[language].moment, locale=STYLES[language].locale)


def _with_space(text: str, unit: str, language: str) -> str:
    return f"{text}{STYLES[language].space}{unit}"


def _unit(value: float, unit: str, places: int, language: str, length: Literal["short", "long"] = "short") -> str:
    return format_unit(round(value, places), unit, length, format=_pattern(places), locale=STYLES[language].locale)


def _pattern(places: int) -> str:
    return "#,##0" + ("." + "0" * places if places else "")
