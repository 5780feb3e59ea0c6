"""When a raster was taken, as its name or its metadata say: of two at one place, the newer one counts."""

import re
from pathlib import Path
from typing import Any, Final

_IN_NAME: Final = re.compile(r"(?<!\d)(19[5-9]\d|20[0-4]\d)(?:[-_.]?(0[1-9]|1[0-2])(?:[-_.]?(0[1-9]|[12]\d|3[01]))?)?(?!\d)")
_IN_TAG: Final = re.compile(r"(\d{4}):(\d\d):(\d\d)")


def date_in_name(path: Path) -> str:
    """Returns the year, month or day in the name of a raster, else of its folder, as `2023`, `2023-05` or `2023-05-01`; empty without one."""
    found = _IN_NAME.search(path.stem) or _IN_NAME.search(path.parent.name)
    return "" if found is None else "-".join(part for part in found.groups() if part)


def date_in_tags(dataset: Any) -> str:
    """Returns the day that a TIFF states; empty without one."""
    found = _IN_TAG.match(dataset.tags().get("TIFFTAG_DATETIME", ""))
    return "" if found is None else "-".join(found.groups())
