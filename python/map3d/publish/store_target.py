"""Publishes to an object store: sends the files whose content changed, the manifest last, and deletes afterwards what no longer belongs.

The checksums file in the store is also the journal: before the first file is overwritten, the digests of all files that may change become UNKNOWN.
A stopped publication is therefore completed by the next one. Archives and search pages have names that follow from their content, and stay for one
more publication, so a visitor with an old page finds old files.
"""

import mimetypes
import shutil
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

from map3d.errors import AlreadyExists
from map3d.object_store import ObjectStore
from map3d.publish.checksums import CHECKSUMS, UNKNOWN, dump_checksums, file_digest, parse_checksums
from map3d.publish.pmtiles_archive import split_archive
from map3d.publish.target import LAST, KeptArchive, MapIdentity, Target, check_publication, is_named_by_content
from map3d.tiles.manifest import FILE_NAME

PARALLEL_REQUESTS: Final = 16
MAX_WAITING: Final = 64
"""Files in memory that wait to be sent."""

IMMUTABLE: Final = "public, max-age=31536000, immutable"
REVALIDATED: Final = "no-cache"

_TYPES: Final = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".json": "application/json",
    ".pmtiles": "application/vnd.pmtiles",
    ".ico": "image/x-icon",
    ".txt": "text/plain; charset=utf-8",
    ".sha256": "text/plain; charset=utf-8",
}


def object_headers(name: str) -> dict[str, str]:
    """Returns the headers with which the store sends a file."""
    suffix = Path(name).suffix
    kind = _TYPES.get(suffix) or mimetypes.guess_type(name)[0] or "application/octet-stream"
    return {"Content-Type": kind, "Cache-Control": IMMUTABLE if is_named_by_content(name) else REVALIDATED}


class StoreTarget(Target):
    """`staging`: folder in which archives are written before they are sent."""

    def __init__(self, store: ObjectStore, staging: Path) -> None:
        super().__init__(store.url)
        self._store, self._staging = store, staging
        self._journal: dict[str, str] = {}
        self._overwriting = False
        self._pool = ThreadPoolExecutor(PARALLEL_REQUESTS)
        self._waiting: deque[Future[str]] = deque()

    def start(self, own: MapIdentity, replace: bool) -> None:
        self.old_sizes = dict(self._store.list())
        sums = self._store.get(CHECKSUMS)
        if self.old_sizes and sums is None:
            raise AlreadyExists(f"{self.url}: contains objects and is not a published rendering; name another prefix")
        self.old_digests = parse_checksums(None if sums is None else sums[0])
        if FILE_NAME in self.old_sizes:
            manifest = self._store.get(FILE_NAME)
            check_publication(None if manifest is None else manifest[0], own, self.url, replace)
        self._journal = {name: digest for name, digest in self.old_digests.items() if name in self.old_sizes}

    def find_archive(self, name: str, metadata: dict[str, Any]) -> KeptArchive | None:
        names = self.find_parts(name, self._journal)
        if not names or any(self._journal[part] == UNKNOWN for part in names):
            return None
        for part in names:
            self.record(part, self._journal[part], self.old_sizes[part], changed=False)
        self.kept_archives += 1
        return KeptArchive(None)

    def archive_path(self, name: str) -> Path:
        return self._staging / name

    def add_archive(self, name: str) -> None:
        path = self._staging / name
        if not self._journal:
            self._write_journal()
        sent = {}
        for part in split_archive(path, self.part_bytes) if self.part_bytes else [path]:
            file = part.relative_to(self._staging).as_posix()
            self._store.put(file, part, headers=object_headers(file))
            self.record(file, file_digest(part), part.stat().st_size, changed=True)
            part.unlink()
            sent[file] = self.digests[file]
        self._journal |= sent
        self._write_journal()

    def add(self, name: str, data: bytes) -> None:
        unchanged = self.is_unchanged(name, data)
        self.record(name, sha256(data).hexdigest(), len(data), changed=not unchanged)
        if unchanged:
            return
        if not (self._overwriting or is_named_by_content(name)):
            self._mark_overwritten()
        self._send(name, data)

    def finish(self) -> None:
        self._wait(0)
        self.divide_old()
        sums = dump_checksums(self.digests)
        if self.removed and not self._overwriting:
            self._mark_overwritten()
        for _ in self._pool.map(self._store.delete, self.removed):
            pass
        unchanged = dump_checksums(self.old_digests) == sums
        if not unchanged or self._overwriting:
            self._store.put(CHECKSUMS, sums, headers=object_headers(CHECKSUMS))
        self.record(CHECKSUMS, sha256(sums).hexdigest(), len(sums), changed=not unchanged)
        self._pool.shutdown()
        shutil.rmtree(self._staging, ignore_errors=True)

    def close(self) -> None:
        """Stops sending. Files that are being sent are completed."""
        self._pool.shutdown(cancel_futures=True)

    def _send(self, name: str, data: bytes) -> None:
        if name in LAST:
            self._wait(0)
            self._store.put(name, data, headers=object_headers(name))
            return
        self._wait(MAX_WAITING)
        self._waiting.append(self._pool.submit(self._store.put, name, data, headers=object_headers(name)))

    def _wait(self, count: int) -> None:
        """Waits until at most `count` files are unsent. Raises the error of a request."""
        while len(self._waiting) > count:
            self._waiting.popleft().result()

    def _mark_overwritten(self) -> None:
        self._overwriting = True
        self._journal = {name: digest if is_named_by_content(name) else UNKNOWN for name, digest in self._journal.items()}
        self._write_journal()

    def _write_journal(self) -> None:
        self._store.put(CHECKSUMS, dump_checksums(self._journal), headers=object_headers(CHECKSUMS))
