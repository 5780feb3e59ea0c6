"""The file `checksums.sha256` of a published rendering, in the format of sha256sum."""

from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Final

CHECKSUMS: Final = "checksums.sha256"
UNKNOWN: Final = "0" * 64
"""Digest of a file that a publication in progress replaces or removes."""


def dump_checksums(digests: Mapping[str, str]) -> bytes:
    """Serializes digests by path."""
    return "".join(f"{digest}  {name}\n" for name, digest in sorted(digests.items())).encode()


def parse_checksums(data: bytes | None) -> dict[str, str]:
    """Returns digests by path; lines that are not understood are ignored."""
    lines = (line.partition("  ") for line in (data or b"").decode(errors="replace").splitlines())
    return {name: digest for digest, _, name in lines if len(digest) == len(UNKNOWN) and name}


def file_digest(path: Path) -> str:
    digest = sha256()
    with path.open("rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()
