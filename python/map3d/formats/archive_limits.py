"""Limits of what archives and packed files may unpack to."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ArchiveLimits:
    """`ratio`: unpacked per packed byte of an entry, checked once `ratio_from_bytes` are unpacked; `name_bytes`: of an entry's whole name."""

    entries: int = 200_000
    bytes: int = 50_000_000_000
    ratio: int = 200
    ratio_from_bytes: int = 1 << 20
    name_bytes: int = 1_024
