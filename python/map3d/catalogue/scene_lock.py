"""The lock of a scene: only one process at a time changes it."""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager

from map3d.catalogue import Workspace


@contextmanager
def scene_lock(workspace: Workspace, scene: str) -> Iterator[None]:
    """Locks the scene while its assets, registry or built files change; the kernel releases the lock when the process ends."""
    folder = workspace.scene_folder(scene)
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
