"""ZIP archives among the files of an import: they are unpacked beside the scene's assets, imported as folders, and the unpacked files are removed."""

import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from map3d.catalogue import Workspace
from map3d.formats.archive_limits import ArchiveLimits
from map3d.ingest.unfinished_imports import draft_path, remove_dead_drafts
from map3d.ingest.zip_archive import is_zip, unpack
from map3d.messages import Message, message

NAME: Final = "_archives"
"""No name of an asset. The folder is a draft of this process: a later import removes it if this one is killed."""

OnArchive = Callable[[str, int, int, Message], None]
"""Called with the name of an archive, the number of its entries that are unpacked, of all, and what happens."""


@dataclass(frozen=True)
class UnpackedFiles:
    """`paths`: those of the import, with a folder in place of each archive; `archives`: folder → archive."""

    paths: tuple[Path, ...]
    archives: tuple[tuple[Path, Path], ...]

    def original(self, text: str) -> str:
        """Returns the text with archives in place of the folders of their unpacked files."""
        for folder, archive in self.archives:
            text = text.replace(str(folder), str(archive))
        return text


@contextmanager
def unpacked(
    workspace: Workspace, scene: str, files: Sequence[Path], progress: OnArchive, limits: ArchiveLimits | None = None
) -> Iterator[UnpackedFiles]:
    """Unpacks the archives among the files into folders named after them, for the duration of the context. Raises the errors of `unpack`."""
    if not any(path.is_file() and is_zip(path) for path in files):
        yield UnpackedFiles(tuple(files), ())
        return
    draft = draft_path(workspace.scene_folder(scene) / "assets" / NAME)
    remove_dead_drafts(draft.parent)
    draft.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(dir=draft))
    try:
        yield _unpack_all(folder, files, progress, limits or ArchiveLimits())
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        with suppress(OSError):
            draft.rmdir()


def _unpack_all(folder: Path, files: Sequence[Path], progress: OnArchive, limits: ArchiveLimits) -> UnpackedFiles:
    paths, archives = list[Path](), list[tuple[Path, Path]]()
    for number, path in enumerate(files):
        if path.is_file() and is_zip(path):
            target = folder / str(number) / path.stem
            unpack(path, target, limits, _show(progress, path.name), str(path))
            archives.append((target, path))
            paths.append(target)
        else:
            paths.append(path)
    return UnpackedFiles(tuple(paths), tuple(archives))


def _show(progress: OnArchive, name: str) -> Callable[[int, int], None]:
    return lambda done, total: progress(name, done, total, message("unpacking"))
