"""Sizes of a published rendering by part: views and layers, objects, search, viewer."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class SizeRow:
    """Files of one part. `part`: tiles, objects, search, columns, gis, viewer or other; `view` and `layer`: of tiles."""

    part: str
    view: str | None
    layer: str | None
    files: int
    bytes: int


def report_sizes(sizes: Mapping[str, int]) -> tuple[SizeRow, ...]:
    """Returns the sizes of files by part, the largest first."""
    parts: dict[tuple[str, str | None, str | None], list[int]] = defaultdict(list)
    for name, size in sizes.items():
        parts[_part_of(name)].append(size)
    rows = (SizeRow(*part, len(found), sum(found)) for part, found in parts.items())
    return tuple(sorted(rows, key=lambda row: (-row.bytes, row.part, row.view or "", row.layer or "")))


def _part_of(name: str) -> tuple[str, str | None, str | None]:
    folder, _, file = name.rpartition("/")
    if name.endswith(".pmtiles"):
        return "tiles", folder, file.rpartition("-")[0]
    if name.startswith("gis/"):
        return "gis", None, None
    if name.startswith("objects/search"):
        return "search", None, None
    if name == "objects/attributes.json" or name.startswith("objects/columns/"):
        return "columns", None, None
    if name.startswith("objects/"):
        return "objects", None, None
    other = folder == "" and file.rpartition(".")[2] in ("json", "txt", "sha256", "jpg")
    return "other" if other else "viewer", None, None
