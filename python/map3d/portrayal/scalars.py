"""Parses numbers, flags and colours of requests. Digits are ASCII, so that every value has one meaning."""

import re
from typing import Final

from map3d.portrayal.service_exception import invalid, quote

MAX_NUMBER: Final = 1e9
"""Greatest absolute number in a request; float64 keeps a tenth of a micrometre below it."""
_NUMBER: Final = re.compile(r"[+-]?(?:[0-9]{1,24}(?:\.[0-9]{0,40})?|\.[0-9]{1,40})(?:[eE][+-]?[0-9]{1,3})?", re.ASCII)
_INTEGER: Final = re.compile(r"\+?[0-9]{1,9}", re.ASCII)
_COLOR: Final = re.compile(r"0x([0-9a-fA-F]{6})", re.ASCII)
_FLAGS: Final = {"true": True, "1": True, "false": False, "0": False}
Color = tuple[int, int, int]


def parse_number(text: str, name: str) -> float:
    """Returns a finite number. Raises InvalidParameterValue."""
    if not _NUMBER.fullmatch(text):
        raise invalid(name, f"{quote(text)} is not a decimal number")
    value = float(text)
    if not abs(value) <= MAX_NUMBER:
        raise invalid(name, f"{quote(text)} is out of range; expected -1e9 to 1e9")
    return value + 0.0


def parse_integer(text: str, name: str, least: int, most: int) -> int:
    """Raises InvalidParameterValue."""
    value = int(text) if _INTEGER.fullmatch(text) else None
    if value is None or not least <= value <= most:
        raise invalid(name, f"{quote(text)}, expected an integer from {least} to {most}")
    return value


def parse_flag(text: str, name: str) -> bool:
    """Returns the value of TRUE, FALSE, 1 or 0, in any case. Raises InvalidParameterValue."""
    value = _FLAGS.get(text.lower())
    if value is None:
        raise invalid(name, f"{quote(text)}, expected true or false")
    return value


def parse_color(text: str, name: str) -> Color:
    """Returns (R, G, B) of 0xRRGGBB. Raises InvalidParameterValue."""
    match = _COLOR.fullmatch(text)
    if match is None:
        raise invalid(name, f"{quote(text)}, expected 0xRRGGBB with a lower-case x")
    value = int(match[1], 16)
    return (value >> 16, value >> 8 & 255, value & 255)


def parse_list(text: str) -> list[str]:
    """Returns the items of a comma-separated list, which may be empty; an empty text is an empty list."""
    return [item.strip() for item in text.split(",")] if text.strip() else []
