"""Uploads in a folder: each has a folder of its own, with `info.json` (name, size, who) and `data`, whose size says how much has arrived.

Nothing else is remembered, so that an upload resumes after any restart. Several processes may share the folder.
"""

import errno
import fcntl
import json
import os
import re
import secrets
import shutil
import threading
import time
from collections.abc import Iterator, Set
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from map3d.errors import BadRequest, LimitExceeded, Map3dError, NotFound, StoreError
from map3d.quantities import size_text
from map3d.uploads.upload_limits import QUOTA_VARIABLE, UploadLimits
from map3d.uploads.upload_names import check_path

INFO: Final = "info.json"
DATA: Final = "data"
RECOUNT_S: Final = 10.0
"""Maximum age of the cached total size of all uploads."""
SYNC_BYTES: Final = 64 << 20
_ID: Final = re.compile(r"[0-9a-f]{16}", re.ASCII)
_BATCH: Final = re.compile(r"[A-Za-z0-9_-]{1,64}", re.ASCII)
_DRAFT: Final = ".new-"


class OffsetConflict(Map3dError):
    """A piece does not begin where the upload ends."""


class WriteInProgress(Map3dError):
    """Another request is writing this upload."""


class ChecksumMismatch(Map3dError):
    """A piece arrived damaged; it was discarded."""


class DiskFull(Map3dError):
    """The disk of the server is full."""


@dataclass(frozen=True)
class Upload:
    """`name`: relative path with `/`. `batch`: what was uploaded together, as the client calls it. `offset`: bytes that have arrived;
    `changed_s`: time of the last one, in seconds since 1970."""

    id: str
    user: str
    name: str
    size: int
    batch: str
    offset: int = 0
    changed_s: float = 0.0

    @property
    def complete(self) -> bool:
        return self.offset == self.size


class Uploads:
    """The uploads of a workspace. Thread-safe. A user sees only the own ones; for another user's, methods raise NotFound."""

    def __init__(self, folder: Path, limits: UploadLimits | None = None) -> None:
        self.folder = folder
        self.limits = limits or UploadLimits()
        self._lock = threading.Lock()
        self._counted_s = float("-inf")
        self._files = self._announced = self._missing = 0

    def create(self, user: str, name: str, size: int, batch: str = "") -> Upload:
        """Raises BadRequest (name, size), LimitExceeded (quota), DiskFull."""
        name = check_path(name)
        if size < 0:
            raise BadRequest(f"upload {name}: has {size} bytes")
        if batch and not _BATCH.fullmatch(batch):
            raise BadRequest(f"batch {batch[:64]!r}: use 1 to 64 of A-Z, a-z, 0-9, '-' and '_'")
        self._reserve(name, size)
        made = Upload(secrets.token_hex(8), user, name, size, batch, 0, time.time())
        draft = self.folder / f"{_DRAFT}{made.id}"
        try:
            draft.mkdir(parents=True)
            (draft / DATA).touch()
            fields = {field: value for field, value in asdict(made).items() if field not in ("id", "offset", "changed_s")}
            (draft / INFO).write_text(json.dumps(fields), encoding="utf-8")
            draft.rename(self.folder / made.id)
        except OSError as error:
            shutil.rmtree(draft, ignore_errors=True)
            raise _failure(error, name) from error
        return made

    def get(self, id: str, user: str) -> Upload:
        """Raises NotFound."""
        found = self._read(id) if _ID.fullmatch(id) else None
        if found is None or found.user != user:
            raise NotFound(f"no upload {id[:64]!r}; it may have expired, or have been imported already")
        return found

    def write(self, id: str, user: str, offset: int) -> "UploadWriter":
        """Opens an upload for a piece that begins at `offset`. Raises NotFound, OffsetConflict, WriteInProgress."""
        found = self.get(id, user)
        try:
            return UploadWriter(self.folder / id / DATA, found, offset)
        except OSError as error:
            raise _failure(error, found.name) from error

    def remove(self, id: str, user: str) -> None:
        """Raises NotFound."""
        self._remove(self.get(id, user).id)

    def batch(self, batch: str, user: str) -> list[Upload]:
        """Returns the uploads of a user's batch, ordered by name."""
        return sorted((one for one in self._all() if one.user == user and one.batch == batch), key=lambda one: one.name)

    def remove_expired(self, in_use: Set[str]) -> int:
        """Removes uploads that have not grown for `expire_s`, and creations that were killed; not those in use. Returns the number of uploads."""
        before_s = time.time() - self.limits.expire_s
        expired = [one.id for one in self._all() if one.changed_s < before_s and one.id not in in_use]
        for id in expired:
            self._remove(id)
        for draft in self.folder.glob(f"{_DRAFT}*"):
            with suppress(OSError):
                if draft.stat().st_mtime < before_s:
                    shutil.rmtree(draft, ignore_errors=True)
        return len(expired)

    def _all(self) -> Iterator[Upload]:
        with suppress(FileNotFoundError):
            for entry in os.scandir(self.folder):
                if _ID.fullmatch(entry.name) and (found := self._read(entry.name)) is not None:
                    yield found

    def _read(self, id: str) -> Upload | None:
        try:
            fields = json.loads((self.folder / id / INFO).read_bytes())
            state = (self.folder / id / DATA).stat()
            return Upload(id, fields["user"], fields["name"], fields["size"], fields["batch"], state.st_size, state.st_mtime)
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def _remove(self, id: str) -> None:
        """Renames the folder first, so that an upload is there as a whole or not at all."""
        gone = self.folder / f"{_DRAFT}{id}-{secrets.token_hex(4)}"
        with suppress(FileNotFoundError):
            (self.folder / id).rename(gone)
            shutil.rmtree(gone, ignore_errors=True)
        self._counted_s = float("-inf")

    def _reserve(self, name: str, size: int) -> None:
        """Counts the upload as announced. Raises LimitExceeded, DiskFull."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with self._lock:
            if time.monotonic() - self._counted_s > RECOUNT_S:
                listed = list(self._all())
                self._files, self._announced = len(listed), sum(one.size for one in listed)
                self._missing = sum(one.size - one.offset for one in listed)
                self._counted_s = time.monotonic()
            if self._files >= self.limits.files:
                raise LimitExceeded(f"upload {name}: {self.limits.files:,} files have been uploaded and not been imported yet; import or remove them")
            if self._announced + size > self.limits.quota_bytes:
                raise LimitExceeded(
                    f"upload {name}: has {size_text(size)}, and {size_text(self._announced)} of the quota of "
                    f"{size_text(self.limits.quota_bytes)} are taken by uploads that have not been imported; import or remove them, "
                    f"or raise the quota with {QUOTA_VARIABLE}"
                )
            free = shutil.disk_usage(self.folder).free - self._missing - self.limits.spare_bytes
            if size > free:
                room = size_text(max(free, 0))
                raise DiskFull(f"upload {name}: has {size_text(size)}, the server's disk has room for {room} more; free some space")
            self._files, self._announced, self._missing = self._files + 1, self._announced + size, self._missing + size


class UploadWriter:
    """Appends a piece to an upload. One at a time, also across processes. Whatever was written stays when it is closed, also early."""

    def __init__(self, path: Path, upload: Upload, offset: int) -> None:
        self.upload = upload
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.offset = self._start = os.fstat(self._file).st_size
            if self.offset != offset:
                raise OffsetConflict(f"upload {upload.name}: {self.offset:,} bytes have arrived, the piece begins at {offset:,}")
        except BlockingIOError:
            os.close(self._file)
            raise WriteInProgress(f"upload {upload.name}: another request is writing it; try again in a few seconds") from None
        except BaseException:
            os.close(self._file)
            raise
        self._unsynced = 0
        self._lock = threading.Lock()
        self._open = True

    def write(self, data: bytes) -> None:
        """Raises BadRequest for bytes beyond the announced size, DiskFull, StoreError. Writes what fits."""
        with self._lock:
            if self._open:
                self._append(data)

    def _append(self, data: bytes) -> None:
        room = self.upload.size - self.offset
        allowed = memoryview(data)[:room]
        try:
            while allowed:
                count = os.write(self._file, allowed)
                self.offset, self._unsynced, allowed = self.offset + count, self._unsynced + count, allowed[count:]
            if self._unsynced >= SYNC_BYTES:
                os.fdatasync(self._file)
                self._unsynced = 0
        except OSError as error:
            raise _failure(error, self.upload.name) from error
        if len(data) > room:
            raise BadRequest(f"upload {self.upload.name}: more than the announced {self.upload.size:,} bytes were sent")

    def discard(self) -> None:
        """Removes what this piece has written."""
        with self._lock:
            os.ftruncate(self._file, self._start)
            self.offset = self._start

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Waits for a `write` of another thread; later ones do nothing."""
        with self._lock:
            if not self._open:
                return
            self._open = False
            try:
                os.fsync(self._file)
            except OSError as error:
                raise _failure(error, self.upload.name) from error
            finally:
                os.close(self._file)


def _failure(error: OSError, name: str) -> Map3dError:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return DiskFull(f"upload {name}: the server's disk is full; free some space and resume the upload")
    if isinstance(error, FileNotFoundError):
        return NotFound(f"upload {name}: was removed")
    return StoreError(f"upload {name}: cannot be written: {error.strerror}")
