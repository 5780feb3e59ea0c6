"""A folder as an object store: one file per object, written as draft → fsync → rename → fsync of the folder.

Conditional writes hold a lock on the file `.lock` in the object's folder, which also works between hosts on NFS. Names that start with "." are
drafts and locks, never objects.
"""

import contextlib
import fcntl
import os
import secrets
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final

from map3d.errors import ObjectChanged, StoreError
from map3d.object_store.contract import ObjectStore, check_object_name

DRAFT_AGE_S: Final = 86_400.0
"""A draft of this age belongs to a killed process."""
CREATE_ATTEMPTS: Final = 100


class FolderStore(ObjectStore):
    """The files of a folder."""

    def __init__(self, root: Path) -> None:
        self.root = root.absolute()

    @property
    def url(self) -> str:
        return self.root.as_uri()

    def get(self, name: str) -> tuple[bytes, str] | None:
        with self._failing(name), self._open(name) as file:
            return None if file is None else (file.read(), _tag(file.fileno()))

    def get_range(self, name: str, start: int, length: int, *, if_match: str | None = None) -> bytes | None:
        with self._failing(name), self._open(name) as file:
            if file is None:
                return None
            if if_match is not None and _tag(file.fileno()) != if_match:
                raise ObjectChanged(f"{self.root / name}: was replaced by another process")
            file.seek(start)
            data = file.read(length)
        if len(data) != length:
            raise StoreError(f"{self.root / name}: expected {length} bytes from byte {start}, got {len(data)}")
        return data

    def get_start(self, name: str, length: int) -> tuple[bytes, str, int] | None:
        with self._failing(name), self._open(name) as file:
            return None if file is None else (file.read(length), _tag(file.fileno()), os.fstat(file.fileno()).st_size)

    def entity_tag(self, name: str) -> str | None:
        with self._failing(name), self._open(name) as file:
            return None if file is None else _tag(file.fileno())

    def exists(self, name: str) -> bool:
        return self._path(name).is_file()

    def put(
        self,
        name: str,
        data: bytes | Path,
        *,
        if_absent: bool = False,
        if_match: str | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> str:
        path = self._path(name)
        with self._failing(name):
            draft = path.with_name(f".{path.name}.{secrets.token_hex(8)}.new")
            try:
                tag = _write(draft, data)
                if not (if_absent or if_match is not None):
                    draft.replace(path)
                elif not self._replace_if(draft, path, if_match):
                    return self._own_bytes(name, data)
                with contextlib.suppress(FileNotFoundError):  # the object and its folder were deleted since
                    _sync_folder(path.parent)
            finally:
                draft.unlink(missing_ok=True)
        return tag

    def delete(self, name: str) -> None:
        with self._failing(name):
            path = self._path(name)
            path.unlink(missing_ok=True)
            with contextlib.suppress(FileNotFoundError):
                while path.parent != self.root and _remove_if_empty(path.parent):
                    path = path.parent

    def list(self, prefix: str = "") -> Iterator[tuple[str, int]]:
        with self._failing(prefix):
            for folder, folders, files in os.walk(self.root / check_object_name(prefix) if prefix else self.root, onerror=_raise):
                folders[:] = sorted(name for name in folders if not name.startswith("."))
                for path in (Path(folder, name) for name in sorted(files) if not name.startswith(".")):
                    with contextlib.suppress(FileNotFoundError):
                        yield path.relative_to(self.root).as_posix(), path.stat().st_size

    def remove_drafts(self) -> None:
        """Deletes the drafts of killed processes."""
        for path in self.root.rglob(".*.new"):
            with contextlib.suppress(FileNotFoundError):
                if time.time() - path.stat().st_mtime > DRAFT_AGE_S:
                    path.unlink()

    def _path(self, name: str) -> Path:
        return self.root / check_object_name(name)

    @contextmanager
    def _open(self, name: str) -> Iterator[IO[bytes] | None]:
        try:
            file = self._path(name).open("rb")
        except (FileNotFoundError, NotADirectoryError):
            yield None
            return
        with file:
            yield file

    def _replace_if(self, draft: Path, path: Path, if_match: str | None) -> bool:
        """Renames the draft if the object is absent, or still has the entity tag."""
        with _locked(path.parent):
            if self.entity_tag(path.relative_to(self.root).as_posix()) != if_match:
                return False
            draft.replace(path)
            return True

    def _own_bytes(self, name: str, data: bytes | Path) -> str:
        """Returns the entity tag if the stored object has the same bytes; raises ObjectChanged otherwise."""
        found = self.get(name)
        if found is None or found[0] != (data if isinstance(data, bytes) else data.read_bytes()):
            raise ObjectChanged(f"{self.root / name}: was created, replaced or deleted by another process")
        return found[1]

    @contextmanager
    def _failing(self, name: str) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise StoreError(f"{self.root / name}: {error.strerror or error}") from error


def _write(draft: Path, data: bytes | Path) -> str:
    """Writes a file durably and returns its entity tag. The time with nanoseconds makes the tag unique even when the inode is used again."""
    with _create(draft) as file:
        if isinstance(data, bytes):
            file.write(data)
        else:
            with data.open("rb") as source:
                shutil.copyfileobj(source, file, 1 << 20)
        file.flush()
        now = time.time_ns()
        os.utime(file.fileno(), ns=(now, now))
        os.fsync(file.fileno())
        return _tag(file.fileno())


def _create(draft: Path) -> IO[bytes]:
    """Creates the draft and its folder, which a process that deletes the last object may remove in between."""
    for _ in range(CREATE_ATTEMPTS):
        with contextlib.suppress(FileNotFoundError, FileExistsError):
            draft.parent.mkdir(parents=True, exist_ok=True)
            return draft.open("xb")
    draft.parent.mkdir(parents=True, exist_ok=True)
    return draft.open("xb")


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Holds the folder's lock; takes it again if its file was removed with the folder meanwhile. Raises FileNotFoundError without the folder."""
    path = folder / ".lock"
    while True:
        with path.open("ab") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            is_current = False
            with contextlib.suppress(FileNotFoundError):
                is_current = os.path.samestat(os.fstat(lock.fileno()), path.stat())
            if is_current:
                yield
                return


def _remove_if_empty(folder: Path) -> bool:
    """Removes a folder that has only its lock."""
    with _locked(folder):
        if [path.name for path in folder.iterdir()] != [".lock"]:
            return False
        (folder / ".lock").unlink()
        with contextlib.suppress(OSError):
            folder.rmdir()
            return True
    return False


def _tag(descriptor: int) -> str:
    stat = os.fstat(descriptor)
    return f"{stat.st_ino:x}-{stat.st_mtime_ns:x}-{stat.st_size:x}"


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _raise(error: OSError) -> None:
    if not isinstance(error, FileNotFoundError):
        raise error
