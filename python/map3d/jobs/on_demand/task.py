"""The task of jobs that are done on demand: renders with less priority, and counts blocks before they are stored."""

import os
from contextlib import suppress
from typing import Final

from map3d.catalogue import JobResult, Lease
from map3d.errors import LimitExceeded, Stopped
from map3d.jobs.on_demand.cache import OnDemandCache
from map3d.renderings.render_task import RenderTask
from map3d.subprocess import Message, Subprocess

NICE: Final = 10
"""The server answers from memory while blocks are rendered."""


class OnDemandTask:
    """Implements `Task`. When the cache has no room, the job is released without losing an attempt, and `refusal` has the reason."""

    def __init__(self, task: RenderTask, cache: OnDemandCache) -> None:
        self._task, self._cache = task, cache
        self.refusal: LimitExceeded | None = None

    def start_subprocess(self) -> Subprocess:
        started = self._task.start_subprocess()
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, started.pid, NICE)
        return started

    def request(self, lease: Lease) -> Message:
        self.refusal = None
        return self._task.request(lease)

    def commit(self, lease: Lease, response: Message) -> JobResult:
        try:
            self._cache.reserve(lease, sum(map(len, response.blobs)))
        except LimitExceeded as error:
            self.refusal = error
            raise Stopped(str(error)) from error
        return self._task.commit(lease, response)
