"""What a rendering is published to, and which files it consists of."""

import json
import re
from abc import ABC, abstractmethod
from collections.abc import Collection
from dataclasses import dataclass
from hashlib import sha256
from itertools import count, takewhile
from pathlib import Path
from typing import Any, Final

from map3d.errors import AlreadyExists
from map3d.publish.checksums import CHECKSUMS, UNKNOWN
from map3d.publish.pmtiles_archive import part_path
from map3d.tiles.manifest import FILE_NAME
from map3d.tiles.viewer_files import PAGE
from map3d.types import Vec3

SEARCH_ROOT: Final = "objects/search.json"
LAST: Final = (SEARCH_ROOT, PAGE, FILE_NAME)
"""Files that refer to others, and are written after them."""

_NAMED_BY_CONTENT: Final = re.compile(r"objects/search/[0-9a-f]{16}\.json|[^/]+/[a-z0-9_-]+-[0-9a-f]{16}(\.[0-9]+)?\.pmtiles")
_DOCUMENT: Final = re.compile(r"objects/[0-9a-z/]+\.json|gis/[0-9.]+-[0-9.]+(/[0-9a-z_-]+/[0-9/]+\.(webp|png|jpg)|(-[0-9a-z_-]+)?\.(wkt|xml|qlr))")


def is_named_by_content(name: str) -> bool:
    """Whether a file of this name always has the same bytes."""
    return _NAMED_BY_CONTENT.fullmatch(name) is not None


def is_written_by_publish(name: str) -> bool:
    """Whether only `map3d publish` writes files of such a name, so that one which is no longer part of the rendering may be deleted."""
    return is_named_by_content(name) or _DOCUMENT.fullmatch(name) is not None


@dataclass(frozen=True)
class MapIdentity:
    """What tells the map of one city from that of another: the name of the rendering, and the origin of its scene, which never changes; None while
    the scene has none."""

    name: str
    origin: Vec3 | None = None

    def is_same(self, other: "MapIdentity") -> bool:
        return self.name == other.name and (None in (self.origin, other.origin) or self.origin == other.origin)


def read_identity(manifest: bytes) -> MapIdentity | None:
    """Returns whose publication a manifest of any version belongs to; None for a file that is no manifest of map3d."""
    try:
        value = json.loads(manifest)
        if value["map3d"] != "rendering":
            return None
        x, y, z = (float(number) for number in value["origin"])
        return MapIdentity(str(value["name"]), (x, y, z))
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def check_publication(manifest: bytes | None, own: MapIdentity, where: str, replace: bool, option: str = "--replace") -> None:
    """Checks that a folder or store, which is not empty, may be published to. `manifest`: its `rendering.json`, or None; `option`: what
    replaces another city's map, as the front that asks names it. Raises AlreadyExists, with `where` in its message."""
    found = None if manifest is None else read_identity(manifest)
    if found is None:
        raise AlreadyExists(f"{where}: contains files and is not a published rendering; name another place")
    if replace or own.is_same(found):
        return
    other = (
        f"the map of another rendering, {found.name}"
        if found.name != own.name
        else f"the map of another scene, whose rendering is called {found.name} too"
    )
    raise AlreadyExists(f"{where}: contains {other}; name another place, or give {option} to replace that map")


@dataclass(frozen=True)
class KeptArchive:
    """An archive that need not be written. `tiles`: None if it was not read."""

    tiles: int | None


class Target(ABC):
    """Receives the files of a publication, then switches to them. Subclasses record in `digests` and `sizes` every file of the new state."""

    dry = False

    def __init__(self, url: str) -> None:
        self.url = url
        self.digests: dict[str, str] = {}
        self.sizes: dict[str, int] = {}
        self.changed: dict[str, int] = {}
        """Sizes of the files that were written or sent."""
        self.removed: list[str] = []
        self.kept_for_open_maps: list[str] = []
        """Files of the publication that this one replaces, which open maps may still read: they stay until the next one."""
        self.kept_archives = 0
        self.part_bytes = 0
        """Size of the files in which archives are divided; 0 for whole archives."""
        self.old_digests: dict[str, str] = {}
        self.old_sizes: dict[str, int] = {}

    @abstractmethod
    def start(self, own: MapIdentity, replace: bool) -> None:
        """Reads the present state. Raises AlreadyExists as `check_publication` does."""

    @abstractmethod
    def find_archive(self, name: str, metadata: dict[str, Any]) -> KeptArchive | None:
        """Keeps a complete archive of this name and metadata; returns None if it has to be written."""

    @abstractmethod
    def archive_path(self, name: str) -> Path:
        """Returns the path under which the archive is to be written."""

    @abstractmethod
    def add_archive(self, name: str) -> None:
        """Takes the archive at `archive_path`."""

    @abstractmethod
    def add(self, name: str, data: bytes) -> None:
        """Takes a file. Files of LAST are visible only after all files before them."""

    @abstractmethod
    def finish(self) -> None:
        """Writes the checksums and removes what no longer belongs."""

    def divide_old(self) -> None:
        """Divides the files of the old publication that are not part of the new state into those that stay for open maps and those to be removed.
        Files that publish did not write are in neither list and stay."""
        present = {*self.old_digests, *filter(is_written_by_publish, self.old_sizes)} & self.old_sizes.keys()
        old = sorted(present - self.digests.keys() - {CHECKSUMS})
        self.kept_for_open_maps = [name for name in old if is_named_by_content(name) and self.old_digests.get(name, UNKNOWN) != UNKNOWN]
        self.removed = sorted(set(old) - set(self.kept_for_open_maps))

    def close(self) -> None:  # noqa: B027
        """Releases what the target holds, also after an error."""

    def find_parts(self, name: str, known: Collection[str]) -> list[str]:
        """Returns the known files of an archive, in order."""
        if not self.part_bytes:
            return [name] if name in known else []
        return list(takewhile(lambda part: part in known, (part_path(Path(name), number).as_posix() for number in count())))

    def record(self, name: str, digest: str, size: int, *, changed: bool) -> None:
        self.digests[name], self.sizes[name] = digest, size
        if changed:
            self.changed[name] = size

    def is_unchanged(self, name: str, data: bytes) -> bool:
        """Whether the present state has this file with these bytes."""
        known = self.old_digests.get(name, UNKNOWN)
        return known != UNKNOWN and self.old_sizes.get(name) == len(data) and sha256(data).hexdigest() == known


class DryRun(Target):
    """Compares with the present state of another target, and writes nothing. Sizes of archives that would be written are estimates."""

    dry = True

    def __init__(self, target: Target) -> None:
        super().__init__(target.url)
        self._target = target

    def start(self, own: MapIdentity, replace: bool) -> None:
        self._target.start(own, replace)
        self.old_digests, self.old_sizes = self._target.old_digests, self._target.old_sizes

    def find_archive(self, name: str, metadata: dict[str, Any]) -> KeptArchive | None:
        names = self.find_parts(name, self.old_sizes)
        if not names or any(self.old_digests.get(part, UNKNOWN) == UNKNOWN for part in names):
            return None
        for part in names:
            self.record(part, self.old_digests[part], self.old_sizes[part], changed=False)
        self.kept_archives += 1
        return KeptArchive(None)

    def archive_path(self, name: str) -> Path:
        raise AssertionError("a dry run writes no archives")

    def add_archive(self, name: str) -> None:
        raise AssertionError("a dry run writes no archives")

    def estimate_archive(self, name: str, size: int) -> None:
        self.record(name, UNKNOWN, size, changed=True)

    def add(self, name: str, data: bytes) -> None:
        self.record(name, sha256(data).hexdigest(), len(data), changed=not self.is_unchanged(name, data))

    def close(self) -> None:
        self._target.close()

    def finish(self) -> None:
        self.divide_old()
