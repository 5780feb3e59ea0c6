"""Checks before something is removed, and the space that it takes."""

import os
import time
from pathlib import Path

from map3d.catalogue import Catalogue, State
from map3d.errors import BadRequest
from map3d.object_store import open_object_store


def check_idle(catalogue: Catalogue, rendering: str) -> None:
    """Raises BadRequest while a worker holds a lease of the rendering, naming the workers."""
    now = time.time()
    workers = {job.worker for job in catalogue.jobs(rendering, state=State.LEASED) if job.worker and (job.expires_s or 0.0) > now}
    if workers:
        shown = ", ".join(sorted(workers)[:3]) + (" …" if len(workers) > 3 else "")
        raise BadRequest(
            f"rendering {rendering}: {len(workers)} workers are rendering it ({shown}); stop map3d render first. "
            "The leases of workers that died on another host expire within a minute"
        )


def folder_bytes(folder: Path) -> int:
    """Returns the size of all files below a folder, 0 if it does not exist. Files that go away meanwhile do not count."""
    total = 0
    for place, _, names in os.walk(folder):
        for name in names:
            try:
                total += os.lstat(os.path.join(place, name)).st_size
            except FileNotFoundError:
                continue
    return total


def objects_bytes(url: str) -> int:
    """Returns the size of all objects below a URL. Raises StoreError."""
    return sum(size for _, size in open_object_store(url).list())
