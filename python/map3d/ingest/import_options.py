"""Options of an import and the limits of the subprocess that parses; the user can raise each limit."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

from map3d.formats import find_format
from map3d.formats.gzip_file import content_bytes
from map3d.formats.source_format import GIB
from map3d.requests.reading import AddFiles, Axes, FormatOptions
from map3d.subprocess import Limits

BIG_FILE_BYTES: Final = 100_000_000
OPEN_FILES: Final = 256


@dataclass(frozen=True, kw_only=True)
class ImportOptions(AddFiles):
    """The request, and what only this host's programs decide. `virtual_rasters`: reads virtual rasters (VRT), which name other files; only for paths
    that the operator of this host gave. `followed_axes`: the order of axes of the other files, for one that does not tell its own."""

    virtual_rasters: bool = False
    followed_axes: Axes = "auto"

    @property
    def placing(self) -> dict[str, str]:
        """The options by which coordinates are read, as far as they are not the default: an asset records only these."""
        known = {"axes": self.axes, "followed_axes": self.followed_axes, "height_unit": self.height_unit}
        return {name: value for name, value in known.items() if value != "auto"}

    @classmethod
    def of(cls, request: FormatOptions, **more: Any) -> "ImportOptions":
        """Returns the options that a request has, and `more`."""
        names = [one.name for one in fields(cls) if hasattr(request, one.name)]
        return cls(**{**{name: getattr(request, name) for name in names}, **more})

    def reader_options(self, format: str, limits: Limits) -> dict[str, Any]:
        """Returns the options of the core's Reader."""
        known = find_format(format)
        options: dict[str, Any] = {"strict": self.strict} | {name: getattr(self, name) for name in known.options}
        sparse = {name: value for name in known.sparse_options if (value := getattr(self, name)) != getattr(type(self), name)}
        options |= {name: list(value) if isinstance(value, tuple) else value for name, value in sparse.items()}
        if limits.address_space_bytes is not None:
            options |= {"max_object_bytes": limits.address_space_bytes // 4, "max_appearance_bytes": limits.address_space_bytes // 4}
        return options

    def limits(self, paths: Sequence[Path], format: str) -> Limits:
        """Returns the limits for files of this size, unpacked, and format. Raises LimitExceeded for a gzip file that unpacks to too much.

        Memory: 1 GiB; 2 GiB for rasters and files over 100 MB. Processor time: 60 s (rasters: 600 s) per 100 MB or part of it. Wall time: four
        times the processor time plus 10 s.
        """
        size = sum(map(content_bytes, paths))
        known = find_format(format)
        cpu_s = self.parse_cpu_s or known.cpu_s * max(1, -(-size // BIG_FILE_BYTES))
        memory = self.parse_memory_bytes or (2 * GIB if size > BIG_FILE_BYTES else known.memory_bytes)
        return Limits(address_space_bytes=memory, cpu_s=cpu_s, wall_s=10.0 + 4.0 * cpu_s, open_files=OPEN_FILES, network=False)
