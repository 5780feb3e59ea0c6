"""The lock of a scene: only one process at a time changes it."""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager

from map3d.catalogue import Workspace
from map3d.errors import BadRequest


@contextmanager
def scene_lock(workspace: Workspace, scene: str, *, wait: bool = True) -> Iterator[None]:
    """Locks the scene while its assets, registry or built files change; the kernel releases the lock when the process ends.

    With `wait` off, raises BadRequest at once while another process holds the lock.
    """
    folder = workspace.scene_folder(scene)
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise BadRequest(f"scene {scene}: another process is building it, planning a render of it or adding files; wait for its end") from error
        yield
