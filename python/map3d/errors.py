"""The errors of map3d: one base class with small subclasses. Every message says what failed, where, what was found and expected, and what to do.

The command line exits with `exit_code`, a key of EXIT_CODES.
"""

from collections.abc import Mapping
from typing import Final

from map3d.messages import Message

FAILED: Final = 1
INVALID: Final = 2
IN_PART: Final = 3
INTERRUPTED: Final = 130
EXIT_CODES: Final[Mapping[int, str]] = {
    0: "done",
    FAILED: "failed, in whole or in part: files that could not be read (`inspect`, `add-files`), blocks in quarantine (`render`, `work`), problems "
    "found (`verify`), a removal that was declined, or any other error; the last line says which",
    INVALID: "invalid request: an unknown option or name, a missing file, a folder that holds something else; nothing was changed",
    IN_PART: "done, although files could not be read, or not as a whole: the site is published (`site`), the files are imported as far as they are "
    "intact (`add-files`, `inspect`)",
    INTERRUPTED: "interrupted with Ctrl-C; the same command resumes",
}
"""Exit code of the command line → what it means. docs/cli.md has this table."""


class Map3dError(Exception):
    """The base class of all errors that map3d raises deliberately. It is made of a message, or of one line of text for the user."""

    exit_code = FAILED
    code = "verbatim"
    """The code of a text."""

    @property
    def message(self) -> Message:
        first = self.args[0] if self.args else ""
        return first if isinstance(first, Message) else Message(self.code, {"text": str(first)})


class BadRequest(Map3dError):
    """The request is invalid."""

    exit_code = INVALID


class NotFound(BadRequest):
    """No scene, asset, rendering, view, job or file has this name."""


class AlreadyExists(BadRequest):
    """The name is already in use."""


class BadName(BadRequest):
    """The name of a scene, rendering or layer does not match `[a-z0-9][a-z0-9_-]{0,63}`."""


class SignInRequired(Map3dError):
    """The request needs a signed-in user or a token."""


class Forbidden(Map3dError):
    """The user may not do this, or the request does not carry the value that proves that a page of this server sent it."""


class UnknownFormat(BadRequest):
    """The file has a format that map3d does not read."""


class CrsError(BadRequest):
    """The coordinate system is unknown, missing, or incompatible with the scene's."""

    code = "crs-unusable"


class ImportFailed(Map3dError):
    """A source document could not be read, or not without loss under `--strict`."""


class LimitExceeded(Map3dError):
    """A limit was reached; the message names the limit, its value and how to raise it."""


class OutsideFrame(Map3dError):
    """The content extends beyond the pinned frame of a rendering; the message names `--regrid`."""


class StaleFence(Map3dError):
    """The lease is no longer held: its fence is older than the job's."""


class StalePlan(Map3dError):
    """The scene has changed since a block was planned; the block has to be planned again."""


class SubprocessDied(Map3dError):
    """A subprocess ended or sent an invalid message; the message says how."""


class SubprocessStartFailed(SubprocessDied):
    """A subprocess reported why it cannot start; another one would fail in the same way."""


class SubprocessTimedOut(SubprocessDied):
    """A subprocess did not respond in time and was killed."""


class Stopped(Map3dError):
    """The user stopped the work; the message says how to resume it."""


class Unavailable(Map3dError):
    """The request cannot be answered now; the message says why, and `retry_s` when to try again."""

    def __init__(self, message: str, retry_s: int) -> None:
        super().__init__(message)
        self.retry_s = retry_s


class UnknownVersion(Map3dError):
    """A file or document has a version that this map3d does not read; the message names both versions."""


class Corrupt(Map3dError):
    """Stored data differ from what was written, in checksum, length or shape."""


class StoreError(Map3dError):
    """Stored data could not be read or written; the message names the path and the cause."""


class ObjectChanged(Map3dError):
    """An object was created, replaced or deleted between reading and writing it."""


class VerifyFailed(Map3dError):
    """`map3d verify` found differences between stored and expected data."""
