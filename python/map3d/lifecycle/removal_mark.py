"""Marks of removals: while a rendering or a scene is removed, the file `.NAME.removing` beside its folder states what is needed to complete it."""

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from map3d.errors import BadRequest


@contextmanager
def removal_mark(folder: Path, content: Mapping[str, Any]) -> Iterator[None]:
    """Marks, durably, that the folder's removal has begun; at the end, that it is complete. After an exception or a kill the mark stays.

    Raises BadRequest while another process holds the mark.
    """
    path = _path(folder)
    path.parent.mkdir(parents=True, exist_ok=True)
    with os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o666), "r+b") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise BadRequest(f"{folder.name}: another process is removing it") from error
        # One write, then the cut: a kill in between leaves the new content with a rest of the old one behind it, which `read_mark` ignores.
        text = json.dumps(content).encode()
        os.pwrite(file.fileno(), text, 0)
        os.ftruncate(file.fileno(), len(text))
        os.fsync(file.fileno())
        yield
        path.unlink(missing_ok=True)


def read_mark(folder: Path) -> dict[str, Any] | None:
    """Returns the content of the mark, empty if its writing was interrupted; None if nothing was being removed."""
    try:
        mark: dict[str, Any] = json.JSONDecoder().raw_decode(_path(folder).read_text(encoding="utf-8"))[0]
    except FileNotFoundError:
        return None
    except ValueError:
        return {}
    return mark


def _path(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.removing")
