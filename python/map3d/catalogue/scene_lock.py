"""One process at a time changes a scene."""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager

from map3d.catalogue import Workspace


@contextmanager
def scene_lock(workspace: Workspace, scene: str) -> Iterator[None]:
    """Held while a scene's assets, registry or built files are changed; the kernel lets go of it when the process ends."""
    folder = workspace.scene_folder(scene)
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
