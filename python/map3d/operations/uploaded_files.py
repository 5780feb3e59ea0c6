"""Files for an import: uploads in the workspace, and files of this host in the folders that its administrator allows."""

import os
import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from map3d.catalogue import Workspace
from map3d.errors import BadRequest, NotFound
from map3d.formats.archive_limits import ArchiveLimits
from map3d.ingest.zip_archive import is_zip, unpack
from map3d.messages import message
from map3d.uploads import Uploads
from map3d.uploads.uploads import DATA

IMPORT_FOLDERS: Final = "MAP3D_IMPORT_FOLDERS"
"""Environment variable: the folders of this host from which operations may import, separated as in PATH."""

OnUnpacked = Callable[[str, int, int], None]
"""Called with the name of an archive, the number of its entries that are unpacked, and of all."""


@dataclass(frozen=True)
class UploadedFile:
    """A complete upload. `name`: relative path with `/`."""

    id: str
    name: str
    path: Path


def uploads_folder(workspace: Workspace) -> Path:
    return workspace.root / "uploads"


def find_upload(workspace: Workspace, id: str, user: str) -> UploadedFile:
    """Returns an upload of the user. Raises NotFound for an unknown one or another user's, BadRequest for an incomplete one."""
    uploads = Uploads(uploads_folder(workspace))
    found = uploads.get(id, user)
    if not found.complete:
        raise BadRequest(f"upload {id} ({found.name}): {found.offset:,} of {found.size:,} bytes have arrived; resume the upload first")
    return UploadedFile(id, found.name, uploads.folder / id / DATA)


def remove_upload(workspace: Workspace, id: str, user: str) -> None:
    """Removes an upload if it is still there."""
    with suppress(NotFound):
        Uploads(uploads_folder(workspace)).remove(id, user)


def check_host_path(text: str) -> Path:
    """Returns the path of a file or folder of this host if it is inside one of the allowed folders. Raises BadRequest, NotFound."""
    allowed = [Path(folder).resolve() for folder in os.environ.get(IMPORT_FOLDERS, "").split(os.pathsep) if folder]
    if not allowed:
        raise BadRequest(f"{text}: this server imports no files of its own disk; its administrator allows folders with {IMPORT_FOLDERS}")
    path = Path(text.replace("\0", "")).resolve()
    if not any(path.is_relative_to(folder) for folder in allowed):
        raise BadRequest(f"{text}: is outside the folders that this server imports from ({IMPORT_FOLDERS}); ask its administrator for their names")
    if not path.exists():
        raise NotFound(f"{text}: no such file or folder")
    return path


def staging_folder(workspace: Workspace, operation: str) -> Path:
    """Returns the folder in which an import arranges uploaded files; its name is not that of an upload."""
    return uploads_folder(workspace) / f".operation-{operation}"


def remove_staging(workspace: Workspace, operation: str) -> None:
    shutil.rmtree(staging_folder(workspace, operation), ignore_errors=True)


def stage(
    workspace: Workspace, operation: str, uploads: Sequence[str], user: str, on_unpacked: OnUnpacked, limits: ArchiveLimits | None = None
) -> Path:
    """Puts the uploads of a user side by side under their names, so that they find each other; unpacks archives into folders named after them.
    Returns the folder. Raises BadRequest when two uploads have the same name, and the errors of `unpack`."""
    remove_staging(workspace, operation)
    folder = staging_folder(workspace, operation)
    folder.mkdir(parents=True)
    for file in [find_upload(workspace, id, user) for id in uploads]:
        packed = is_zip(file.path)
        target = folder / (Path(file.name).with_suffix("") if packed else file.name)
        if target.exists():
            raise BadRequest(message("upload-name-taken", file=file.name))
        target.parent.mkdir(parents=True, exist_ok=True)
        if packed:
            unpack(file.path, target, limits or ArchiveLimits(), _show(on_unpacked, file.name), file.name)
        else:
            _link(file.path, target)
    return folder


def _show(on_unpacked: OnUnpacked, name: str) -> Callable[[int, int], None]:
    return lambda done, total: on_unpacked(name, done, total)


def _link(source: Path, target: Path) -> None:
    """Links a file, or copies it where the file system has no links."""
    with suppress(OSError):
        os.link(source, target)
        return
    shutil.copyfile(source, target)
