"""Unpacks ZIP archives: regular files only, inside the folder, with limits on their actual bytes.

It runs in a limited subprocess, because the list of entries of a hostile archive can fill the memory.
"""

import shutil
import stat
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path, PurePosixPath
from typing import Any, Final

from map3d.errors import ImportFailed, LimitExceeded, Map3dError, SubprocessDied
from map3d.formats.archive_limits import ArchiveLimits
from map3d.messages import message
from map3d.subprocess import Failure, Handler, Limits, Subprocess

_SIGNATURE: Final = b"PK\x03\x04"
_EMPTY: Final = b"PK\x05\x06"
_STEP_BYTES: Final = 1 << 20
_ENCRYPTED: Final = 0x1
_MEMORY_BYTES: Final = 1 << 30
_START_S: Final = 60.0
_DAMAGE: Final = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, OSError, ValueError, RuntimeError)
"""What Python's zipfile raises for damaged and encrypted archives and for unknown methods of compression."""


def is_zip(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(4) in (_SIGNATURE, _EMPTY)


def unpack(
    archive: Path,
    folder: Path,
    limits: ArchiveLimits,
    progress: Callable[[int, int], None],
    name: str | None = None,
    suffixes: Sequence[str] = (),
) -> int:
    """Unpacks all files of the archive into the new folder; returns their number. `progress` receives the entries done and all.
    `name`: what errors call the archive. `suffixes`: unpacks nothing, and returns 0, unless a file has one of these.

    Archives in the archive stay packed. Raises ImportFailed for a damaged or encrypted archive and for entries that are links or lead out of the
    folder, LimitExceeded. The folder may then have files of the archive.
    """

    def show(done: list[int] | None) -> None:
        if done is not None:
            progress(*done)

    limited = Limits(address_space_bytes=_MEMORY_BYTES, open_files=64, network=False)
    process = Subprocess(f"{__name__}:open_unpacker", {}, limits=limited)
    try:
        process.wait_ready(_START_S)
        named = {"archive": str(archive), "name": name or archive.name, "folder": str(folder)}
        request = named | {"limits": asdict(limits), "suffixes": list(suffixes)}
        answer = process.request(request, wall_s=None, on_progress=show)
    except LimitExceeded as error:
        raise LimitExceeded(f"{name or archive.name}: {error}; the archive has too many entries; divide it") from error
    except SubprocessDied as error:
        raise ImportFailed(message("archive-not-unpacked", file=name or archive.name, reason=error.message)) from error
    finally:
        process.close()
    if isinstance(answer, Failure):
        raise (LimitExceeded if answer.kind == "LimitExceeded" else ImportFailed)(answer.message)
    return int(answer.value["files"])


def open_unpacker(_setup: dict[str, Any]) -> Handler:
    """Returns the handler of the subprocess."""

    def handle(request: dict[str, Any], _blobs: list[bytes], report: Callable[[Any], None]) -> tuple[dict[str, Any], Sequence[bytes]]:
        archive, folder, limits = Path(request["archive"]), Path(request["folder"]), ArchiveLimits(**request["limits"])
        files = unpack_here(archive, folder, limits, lambda *done: report(done), request["name"], request["suffixes"])
        return {"files": files}, []

    return handle


def unpack_here(
    archive: Path,
    folder: Path,
    limits: ArchiveLimits,
    progress: Callable[[int, int], None] = lambda *_: None,
    name: str | None = None,
    suffixes: Sequence[str] = (),
) -> int:
    """Unpacks in this process, otherwise like `unpack`."""
    called = name or archive.name
    try:
        with zipfile.ZipFile(archive) as opened:
            entries = list(_checked_entries(called, opened.infolist(), limits))
            if suffixes and not any(place.suffix.lower() in suffixes for _, place in entries):
                return 0
            _check_space(called, folder, sum(entry.file_size for entry, _ in entries))
            written = 0
            for number, (entry, place) in enumerate(entries):
                progress(number, len(entries))
                written += _write_entry(opened, entry, folder / place, called, limits, limits.bytes - written)
            progress(len(entries), len(entries))
            return len(entries)
    except Map3dError:
        raise
    except _DAMAGE as error:
        raise ImportFailed(f"{called}: cannot be unpacked: {error or type(error).__name__}") from error


def _checked_entries(archive: str, listed: list[zipfile.ZipInfo], limits: ArchiveLimits) -> Iterator[tuple[zipfile.ZipInfo, PurePosixPath]]:
    """Yields the entries that are files, with their relative path."""
    if len(listed) > limits.entries:
        raise LimitExceeded(f"{archive}: has {len(listed):,} entries, at most {limits.entries:,} are allowed; divide it")
    taken = set[PurePosixPath]()
    for entry in listed:
        name = _checked_name(archive, entry, limits)
        kind = stat.S_IFMT(entry.external_attr >> 16)
        if entry.is_dir() or kind == stat.S_IFDIR:
            continue
        if kind not in (0, stat.S_IFREG):
            raise ImportFailed(f"{archive}: entry {entry.filename!r} is a link or a device; only files and folders are unpacked")
        if entry.flag_bits & _ENCRYPTED:
            raise ImportFailed(f"{archive}: entry {entry.filename!r} is encrypted; pack the archive without a password")
        if name in taken:
            raise ImportFailed(f"{archive}: entry {entry.filename!r} is there twice")
        taken.add(name)
        yield entry, name


def _checked_name(archive: str, entry: zipfile.ZipInfo, limits: ArchiveLimits) -> PurePosixPath:
    """Returns the entry's name as a relative path; some programs write backslashes."""
    size = len(entry.filename.encode("utf-8", "surrogatepass"))
    if size > limits.name_bytes:
        raise LimitExceeded(f"{archive}: the name of an entry has {size:,} bytes, at most {limits.name_bytes:,} are allowed")
    path = PurePosixPath(entry.filename.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts or ":" in (path.parts or ("",))[0] or _has_control_characters(entry.filename):
        raise ImportFailed(f"{archive}: entry {entry.filename!r} would be unpacked outside the folder or has control characters in its name")
    return path


def _has_control_characters(name: str) -> bool:
    return any(ord(letter) < 0x20 or 0x7F <= ord(letter) < 0xA0 or 0xD800 <= ord(letter) < 0xE000 for letter in name)


def _check_space(archive: str, folder: Path, need: int) -> None:
    folder.mkdir(parents=True)
    free = shutil.disk_usage(folder).free
    if need > free:
        raise LimitExceeded(f"{archive}: needs {need / 1e9:.1f} GB unpacked, {free / 1e9:.1f} GB of the disk are free")


def _write_entry(opened: zipfile.ZipFile, entry: zipfile.ZipInfo, path: Path, archive: str, limits: ArchiveLimits, remaining: int) -> int:
    """Writes one file; counts its bytes as they come, whatever the archive claims. Returns their number."""
    path.parent.mkdir(parents=True, exist_ok=True)
    written = 0
    with opened.open(entry) as source, path.open("xb") as target:
        while part := source.read(_STEP_BYTES):
            written += len(part)
            if written > remaining:
                raise LimitExceeded(f"{archive}: unpacks to more than {limits.bytes:,} bytes; divide it")
            if written > limits.ratio_from_bytes and written > limits.ratio * max(entry.compress_size, 1):
                raise LimitExceeded(
                    f"{archive}: entry {entry.filename!r} grows to more than {limits.ratio} times its packed size; pack it again with another program"
                )
            target.write(part)
    return written
