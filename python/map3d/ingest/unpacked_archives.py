"""ZIP archives among the files of an import, or in its folders: unpacked beside the scene's assets until the import ends."""

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from map3d.catalogue import Workspace
from map3d.errors import ImportFailed, LimitExceeded
from map3d.formats import FORMATS
from map3d.formats.archive_limits import ArchiveLimits
from map3d.ingest.unfinished_imports import draft_path, remove_dead_drafts
from map3d.ingest.zip_archive import is_zip, unpack
from map3d.messages import Message, message

NAME: Final = "_archives"
"""No name of an asset. The folder is a draft of this process: a later import removes it if this one is killed."""

SUFFIX: Final = ".zip"
"""Archives in a folder are known by it and by their content; other programs' files, such as those of offices, are ZIP archives, too."""

_WORTH_UNPACKING: Final = (".gz", ".xml", *(suffix for format in FORMATS for suffix in format.suffixes))
"""An archive in a folder without files of these suffixes stays packed."""

OnArchive = Callable[[str, int, int, Message], None]
"""Called with the name of an archive, the number of its entries that are unpacked, of all, and what happens."""


@dataclass(frozen=True)
class UnpackedArchive:
    """`folder`: of its files, None if it stays packed since it has none to read; `within`: the given folder that holds it, None if it was given."""

    archive: Path
    folder: Path | None
    within: Path | None = None


@dataclass(frozen=True)
class UnpackedFiles:
    """`paths`: those of the import, with a folder in place of each archive; `failed`: archives in folders that cannot be unpacked, and why."""

    paths: tuple[Path, ...]
    archives: tuple[UnpackedArchive, ...] = ()
    failed: tuple[tuple[Path, Message], ...] = ()

    def within(self, folder: Path) -> list[UnpackedArchive]:
        """Returns the archives in a given folder."""
        return [archive for archive in self.archives if archive.within == folder]

    def is_archive(self, path: Path) -> bool:
        """Whether a path is one of the archives in the folders, unpacked or not."""
        return any(path == archive.archive for archive in self.archives) or any(path == failed for failed, _ in self.failed)

    def place(self, path: Path) -> Path:
        """Returns the path as the user knows it: that of an unpacked file leads through its archive."""
        for archive in self.archives:
            if archive.folder is not None and path.is_relative_to(archive.folder):
                return archive.archive / path.relative_to(archive.folder)
        return path

    def is_there(self, place: Path) -> bool:
        """Whether there is a file at a path that may lead through an archive; in one that cannot be unpacked, nothing is known to be gone."""
        for archive in self.archives:
            if place.is_relative_to(archive.archive.absolute()) and archive.folder is not None:
                return os.path.lexists(archive.folder / place.relative_to(archive.archive.absolute()))
        return os.path.lexists(place) or any(place.is_relative_to(failed.absolute()) for failed, _ in self.failed)

    def original(self, text: str) -> str:
        """Returns the text with archives in place of the folders of their unpacked files."""
        for archive in self.archives:
            if archive.folder is not None:
                text = text.replace(str(archive.folder), str(archive.archive))
        return text


@contextmanager
def unpacked(
    workspace: Workspace, scene: str, files: Sequence[Path], progress: OnArchive, limits: ArchiveLimits | None = None
) -> Iterator[UnpackedFiles]:
    """Unpacks the archives among the files, and those in folders among them, for the duration of the context. Raises the errors of `unpack` for an
    archive that was given itself."""
    given = [path for path in files if path.is_file() and is_zip(path)]
    inside = [(path, folder) for folder in files if folder.is_dir() for path in _find_archives(folder)]
    if not given and not inside:
        yield UnpackedFiles(tuple(files))
        return
    draft = draft_path(workspace.scene_folder(scene) / "assets" / NAME)
    remove_dead_drafts(draft.parent)
    draft.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(dir=draft))
    try:
        yield _unpack_all(folder, files, given, inside, progress, limits or ArchiveLimits())
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        with suppress(OSError):
            draft.rmdir()


def _find_archives(folder: Path) -> Iterator[Path]:
    paths = (Path(place, name) for place, _, names in os.walk(folder) for name in names)
    yield from sorted(path for path in paths if path.suffix.lower() == SUFFIX and not path.name.startswith(".") and path.is_file() and is_zip(path))


def _unpack_all(
    folder: Path, files: Sequence[Path], given: Sequence[Path], inside: Sequence[tuple[Path, Path]], progress: OnArchive, limits: ArchiveLimits
) -> UnpackedFiles:
    archives, failed, targets = list[UnpackedArchive](), list[tuple[Path, Message]](), dict[Path, Path]()
    for number, (path, within) in enumerate([*((path, None) for path in given), *inside]):
        target = folder / str(number) / path.stem
        wanted = () if within is None else _WORTH_UNPACKING
        try:
            count = unpack(path, target, limits, _show(progress, path.name), str(path), wanted)
        except (ImportFailed, LimitExceeded) as error:
            if within is None:
                raise
            failed.append((path, error.message))
            shutil.rmtree(target, ignore_errors=True)
            continue
        archives.append(UnpackedArchive(path, target if count or within is None else None, within))
        if within is None:
            targets[path] = target
    return UnpackedFiles(tuple(targets.get(path, path) for path in files), tuple(archives), tuple(failed))


def _show(progress: OnArchive, name: str) -> Callable[[int, int], None]:
    return lambda done, total: progress(name, done, total, message("unpacking"))
