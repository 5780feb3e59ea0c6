"""The errors of map3d: one base class, small leaves. Every message says what, where, got and expected, and what to do.

`exit_code` is what the command line returns: 2 for a request that cannot be meant, 1 for a task that failed.
"""


class Map3dError(Exception):
    """Base of all errors that map3d raises on purpose; its text is one line for the user."""

    exit_code = 1


class BadRequest(Map3dError):
    """The caller asks for something that cannot be done as asked."""

    exit_code = 2


class NotFound(BadRequest):
    """No scene, asset, rendering, view, job or file of that name."""


class AlreadyExists(BadRequest):
    """The name is taken."""


class BadName(BadRequest):
    """A name of a scene, rendering or layer that does not match `[a-z0-9][a-z0-9_-]{0,63}`."""


class UnknownFormat(BadRequest):
    """A file that is none of the formats that map3d reads."""


class CrsError(BadRequest):
    """A coordinate system that is unknown, missing, or does not fit the scene's."""


class ImportFailed(Map3dError):
    """A source document could not be read at all, or not without loss under `--strict`."""


class LimitExceeded(Map3dError):
    """A limit was met; the message names it, its value and how to raise it."""


class OutsideFrame(Map3dError):
    """Content lies outside the pinned frame of a rendering; the message names `--regrid`."""


class StaleFence(Map3dError):
    """A lease is no longer held: its fence is older than the job's."""


class ChildDied(Map3dError):
    """A child process ended, hung or answered nonsense; the message says how."""


class ChildRefused(ChildDied):
    """A child could not begin and said why: the next one would say the same."""


class Stopped(Map3dError):
    """The user stopped the work; the message says how to go on."""


class UnknownVersion(Map3dError):
    """A file or document of a version that this map3d does not know; the message names both numbers."""


class Corrupt(Map3dError):
    """Something stored is not what was written: checksum, length or shape differ."""


class StoreError(Map3dError):
    """Reading or writing stored data failed; the message has the path and the cause."""


class CoreMissing(Map3dError):
    """The compiled module `map3d._core` cannot be imported."""


class VerifyFailed(Map3dError):
    """`map3d verify` found differences between what is stored and what should be."""
