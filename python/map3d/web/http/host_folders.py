"""Removes the folders of the server's host from texts that leave it."""

import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from map3d.web.http.current import workspace

_HOST_FOLDER: Final = re.compile(r"(?:file://|(?<![^\s(\"'\[=,:]))/(?:[^\s/]+/)+")
"""The folders of an absolute path of the host, also as a URL. The `//` of other URLs begins none."""


def without_host_folders(text: str) -> str:
    """Returns a message without the folders of the server's host: paths in the workspace begin there, others keep their last name."""
    root = workspace().root.absolute()
    return _HOST_FOLDER.sub("", _staged(root).sub("", text).replace(f"{root}/", "").replace(str(root), "."))


def values_without_host_folders(value: Any) -> Any:
    """Returns a JSON value whose texts have no folders of the server's host."""
    match value:
        case str():
            return without_host_folders(value)
        case Mapping():
            return {name: values_without_host_folders(part) for name, part in value.items()}
        case list() | tuple():
            return [values_without_host_folders(part) for part in value]
        case _:
            return value


@lru_cache
def _staged(root: Path) -> re.Pattern[str]:
    """Returns a pattern of the folder in which an import arranges uploaded files."""
    return re.compile(re.escape(str(root)) + r"/uploads/\.operation-[0-9]+/")
