"""The limits of uploads, and the environment variables that change them."""

import os
import re
from dataclasses import dataclass
from typing import Final

from map3d.errors import BadRequest

QUOTA_VARIABLE: Final = "MAP3D_UPLOAD_QUOTA"
_UNITS: Final = {"": 1, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30, "t": 1 << 40}


@dataclass(frozen=True)
class UploadLimits:
    """`quota_bytes`: of all uploads in the workspace together, whether they have arrived or are only announced. `spare_bytes`: of the disk, that stay
    free. `files`: uploads in the workspace. `expire_s`: an upload is removed this long after its last byte."""

    quota_bytes: int = 200 << 30
    spare_bytes: int = 1 << 30
    files: int = 250_000
    expire_s: int = 48 * 3600


def limits_from_environment() -> UploadLimits:
    """Raises BadRequest for an invalid quota."""
    text = os.environ.get(QUOTA_VARIABLE)
    if not text:
        return UploadLimits()
    match = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)([kmgt]?)i?b?", text.strip().lower(), re.ASCII)
    if match is None:
        raise BadRequest(f"{QUOTA_VARIABLE}={text}: is not a size; write e.g. 500G or 2T")
    return UploadLimits(quota_bytes=int(float(match[1]) * _UNITS[match[2]]))
