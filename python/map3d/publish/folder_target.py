"""Publishes to a folder: a draft beside it replaces it in one step. Unchanged archives are linked, not written again."""

import os
import shutil
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from map3d.errors import Corrupt
from map3d.publish.checksums import CHECKSUMS, UNKNOWN, dump_checksums, file_digest, parse_checksums
from map3d.publish.pmtiles_archive import Archive, existing_parts, split_archive
from map3d.publish.target import KeptArchive, MapIdentity, Target, check_publication
from map3d.tiles.manifest import FILE_NAME


class FolderTarget(Target):
    """The draft has a hidden name. After a stop, the next attempt reuses its finished archives."""

    def __init__(self, folder: Path) -> None:
        super().__init__(str(folder))
        self.folder = folder.absolute()
        self.draft = draft_of(self.folder)

    def start(self, own: MapIdentity, replace: bool) -> None:
        check_folder(self.folder, own, replace)
        if not self.folder.is_dir():
            return
        sums = self.folder / CHECKSUMS
        if sums.is_file():
            self.old_digests = parse_checksums(sums.read_bytes()) | {CHECKSUMS: file_digest(sums)}
        self.old_sizes = {path.relative_to(self.folder).as_posix(): path.stat().st_size for path in self.folder.rglob("*") if path.is_file()}

    def find_archive(self, name: str, metadata: dict[str, Any]) -> KeptArchive | None:
        tiles = count_finished_tiles(self.draft / name, metadata, self.part_bytes)
        if tiles:
            digests = {path: file_digest(path) for path in existing_parts(self.draft / name, self.part_bytes)}
        else:
            published = {path: path.relative_to(self.folder).as_posix() for path in existing_parts(self.folder / name, self.part_bytes)}
            if all(self.old_digests.get(file, UNKNOWN) != UNKNOWN for file in published.values()):
                tiles = count_finished_tiles(self.folder / name, metadata, self.part_bytes)
            if not tiles:
                return None
            for path, file in published.items():
                _link(path, self.draft / file)
            digests = {self.draft / file: self.old_digests[file] for file in published.values()}
        for path, digest in digests.items():
            self.record(path.relative_to(self.draft).as_posix(), digest, path.stat().st_size, changed=False)
        self.kept_archives += 1
        return KeptArchive(tiles)

    def archive_path(self, name: str) -> Path:
        return self.draft / name

    def add_archive(self, name: str) -> None:
        path = self.draft / name
        for part in split_archive(path, self.part_bytes) if self.part_bytes else [path]:
            self.record(part.relative_to(self.draft).as_posix(), file_digest(part), part.stat().st_size, changed=True)

    def add(self, name: str, data: bytes) -> None:
        path = self.draft / name
        unchanged = self.is_unchanged(name, data) and (self.folder / name).read_bytes() == data
        if unchanged:
            _link(self.folder / name, path)
        else:
            _write(path, data)
        self.record(name, sha256(data).hexdigest(), len(data), changed=not unchanged)

    def finish(self) -> None:
        self.add(CHECKSUMS, dump_checksums(self.digests))
        self._remove_leftovers()
        self.divide_old()
        for name in self.old_sizes.keys() - self.digests.keys() - set(self.removed):
            _link(self.folder / name, self.draft / name)
        _replace_folder(self.draft, self.folder)

    def _remove_leftovers(self) -> None:
        """Removes the files of earlier attempts that this one did not write."""
        for path in sorted(self.draft.rglob("*"), reverse=True):
            if path.is_file() and path.relative_to(self.draft).as_posix() not in self.digests:
                path.unlink()
            elif path.is_dir() and not any(path.iterdir()):
                path.rmdir()


def draft_of(folder: Path) -> Path:
    """Returns the place where a folder is written before it replaces the published one."""
    return folder.with_name(f".{folder.name}.publishing")


def old_of(folder: Path) -> Path:
    """Returns the place of a folder that was replaced, until it is removed."""
    return folder.with_name(f".{folder.name}.old")


def count_finished_tiles(path: Path, metadata: dict[str, Any], part_bytes: int = 0) -> int:
    """Returns the number of tiles in a complete archive with this metadata; 0 without one."""
    if not all(map(Path.is_file, existing_parts(path, part_bytes) or [path])):
        return 0
    try:
        archive = Archive(path, part_bytes)
        return archive.count_tiles() if archive.metadata == metadata else 0
    except Corrupt:
        return 0


def check_folder(folder: Path, own: MapIdentity, replace: bool, where: str | None = None, option: str = "--replace") -> None:
    """Checks whether a map can be published to a folder. `where` and `option`: as `check_publication` has them. Raises AlreadyExists."""
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    manifest = folder / FILE_NAME
    check_publication(manifest.read_bytes() if manifest.is_file() else None, own, where or str(folder), replace, option)


def _link(source: Path, path: Path) -> None:
    """Links a file, or copies it where the file system has no links."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    with suppress(OSError):
        os.link(source, path)
        return
    shutil.copyfile(source, path)


def _write(path: Path, data: bytes) -> None:
    """Writes a new file: an old one of this name may be a link to a published file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    with path.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _replace_folder(draft: Path, folder: Path) -> None:
    old = old_of(folder)
    shutil.rmtree(old, ignore_errors=True)
    if folder.exists():
        folder.rename(old)
    draft.rename(folder)
    shutil.rmtree(old, ignore_errors=True)
