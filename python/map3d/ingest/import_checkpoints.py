"""Checkpoints of long imports: finished parts that outlive a killed import and serve the next one of the same inputs.

The folder `.NAME.KEY.pieces` lies beside the asset; KEY is the digest of everything that they depend on. Checkpoints of other inputs are removed.
"""

import fcntl
import hashlib
import json
import os
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

_SUFFIX: Final = ".pieces"
_LOCK: Final = "lock"
KEEP_S: Final = 7 * 86_400.0
"""Checkpoints of an asset that is not imported again are removed after a week."""


def checkpoints_key(inputs: Mapping[str, Any]) -> str:
    """`inputs`: JSON values on which the checkpoints depend."""
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()[:32]


@contextmanager
def import_checkpoints(asset: Path, key: str) -> Iterator[Path | None]:
    """Yields the folder for the checkpoints of an asset, locked; None while another process imports the same. Removes it
    unless an exception leaves the block: then the next import may resume with it."""
    _remove_others(asset.parent, asset.name, key)
    folder = asset.with_name(f".{asset.name}.{key}{_SUFFIX}")
    folder.mkdir(parents=True, exist_ok=True)
    lock = _lock(folder)
    if lock is None:
        yield None
        return
    try:
        os.utime(folder)
        yield folder
        shutil.rmtree(folder, ignore_errors=True)
    finally:
        os.close(lock)


def remove_checkpoints(asset: Path) -> None:
    """Removes the checkpoints of an asset, unless a process uses them."""
    _remove_others(asset.parent, asset.name, None)


def _remove_others(assets: Path, name: str, key: str | None) -> None:
    """Removes the asset's checkpoints of other inputs, and old checkpoints of any asset."""
    for path in assets.glob(f".*{_SUFFIX}"):
        owner, _, found = path.name.removesuffix(_SUFFIX).removeprefix(".").partition(".")
        if (owner == name and found != key) or (owner != name and time.time() - path.stat().st_mtime > KEEP_S):
            lock = _lock(path)
            if lock is not None:
                shutil.rmtree(path, ignore_errors=True)
                os.close(lock)


def _lock(folder: Path) -> int | None:
    """Returns a descriptor that holds the folder's lock; None while another process holds it."""
    try:
        descriptor = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor
