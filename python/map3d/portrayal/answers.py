"""Answers of the service, without HTTP: status, media type, body and headers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

BOUNDARY: Final = "3DPS_MULTIPART_MESSAGE_BOUNDARY"
"""The boundary that OGC 15-001r4 §10.5.1 prescribes."""

NO_STORE: Final = {"Cache-Control": "no-store"}
REVALIDATE: Final = {"Cache-Control": "no-cache"}


@dataclass(frozen=True)
class Answer:
    status: int
    media_type: str
    body: bytes
    headers: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class ImagePart:
    """An encoded image layer of a view."""

    media_type: str
    data: bytes


def image_answer(parts: Sequence[ImagePart], headers: Mapping[str, str]) -> Answer:
    """Returns the image itself if it is the only one, else a multipart/mixed message with the parts in order."""
    if len(parts) == 1:
        return Answer(200, parts[0].media_type, parts[0].data, headers)
    lines = []
    for part in parts:
        lines += [f"--{BOUNDARY}\r\nContent-Type: {part.media_type}\r\nContent-Length: {len(part.data)}\r\n\r\n".encode(), part.data, b"\r\n"]
    lines.append(f"--{BOUNDARY}--\r\n".encode())
    return Answer(200, f'multipart/mixed; boundary="{BOUNDARY}"', b"".join(lines), headers)
