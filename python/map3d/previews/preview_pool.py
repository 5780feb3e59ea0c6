"""Asks limited subprocesses for previews and estimates: a few at a time, with a bounded queue; each answer is kept until the scene changes."""

import hashlib
import json
import threading
from collections import OrderedDict
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from functools import lru_cache
from typing import Any, Final

from map3d.catalogue import Catalogue, RenderingRecord, SceneRecord, Workspace, codec
from map3d.errors import BadRequest, Map3dError, SubprocessDied
from map3d.lifecycle.create_rendering import draft_rendering
from map3d.requests import CreateRendering
from map3d.scenes.build import is_stale, open_scene
from map3d.subprocess import Failure, Limits, Message, Subprocess
from map3d.types import Box, Layer, ViewAngles

PROCESSES: Final = 2
QUEUE: Final = 6
START_S: Final = 30.0
WALL_S: Final = 30.0
KEPT: Final = 200
"""Answers that are kept: pictures of about 60 kB."""
LIMITS: Final = Limits(cpu_s=60, open_files=4096, network=False)
"""Without a limit of the address space, because built scenes are mapped into it."""
RENDERING_COLUMNS: Final = (
    "name", "scene", "title", "attribution", "res_m", "passes", "frames", "box", "options", "content_version", "announced_version", "planning",
)  # fmt: skip


class PreviewBusy(Map3dError):
    """Too many previews are asked for at the same time."""


class PreviewPool:
    """One per server process; thread-safe. Its subprocesses start with the first request."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._threads = ThreadPoolExecutor(PROCESSES, thread_name_prefix="previews")
        self._local = threading.local()
        self._room = threading.BoundedSemaphore(PROCESSES + QUEUE)
        self._lock = threading.Lock()
        self._kept: OrderedDict[str, Message] = OrderedDict()
        self._processes: set[Subprocess] = set()

    def picture(self, catalogue: Catalogue, scene: str, view: ViewAngles, layer: Layer, res_m: float | None, at: tuple[float, float] | None) -> bytes:
        """Returns a JPEG, see `view_preview.picture`. Raises BadRequest when the scene is not built, PreviewBusy."""
        request = {"kind": "picture", "view": list(view), "layer": asdict(layer), "res_m": res_m, "at": at}
        return self._ask(self._scene_request(catalogue, scene) | request).blobs[0]

    def estimate(self, catalogue: Catalogue, request: CreateRendering, workers: int) -> dict[str, Any]:
        """Returns the fields of RenderingEstimate for a rendering that does not exist yet. Raises like `check_rendering`, PreviewBusy."""
        record = draft_rendering(self._workspace, catalogue, request)
        asked = {"kind": "estimate", "rendering": _dump(record), "workers": workers}
        return self._ask(self._scene_request(catalogue, request.scene) | asked).value

    def box(self, catalogue: Catalogue, scene: str) -> Box:
        """Returns the local box of a built scene. Raises BadRequest."""
        return _box(self._workspace, scene, str(self._built(catalogue, scene).built))

    def close(self) -> None:
        """Waits for the current requests, then ends the subprocesses."""
        self._threads.shutdown(cancel_futures=True)
        with self._lock:
            processes, self._processes = self._processes, set()
        for process in processes:
            process.close()

    def _built(self, catalogue: Catalogue, scene: str) -> SceneRecord:
        record = catalogue.scene(scene)
        if is_stale(self._workspace, catalogue, scene):
            raise BadRequest(f"scene {scene} has changed since its last build; build it first")
        return record

    def _scene_request(self, catalogue: Catalogue, scene: str) -> dict[str, Any]:
        return {"scene": str(self._workspace.scene_folder(scene).absolute()), "built": self._built(catalogue, scene).built}

    def _ask(self, request: Mapping[str, Any]) -> Message:
        key = hashlib.sha256(json.dumps(request, sort_keys=True).encode()).hexdigest()
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        if not self._room.acquire(blocking=False):
            raise PreviewBusy("too many previews are being rendered; try again in a few seconds")
        try:
            answer = self._threads.submit(self._request, dict(request)).result()
        finally:
            self._room.release()
        with self._lock:
            self._kept[key] = answer
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        return answer

    def _request(self, request: dict[str, Any]) -> Message:
        """Runs in a thread of the pool, whose end would be its subprocess's end."""
        process: Subprocess | None = getattr(self._local, "process", None)
        try:
            if process is None:
                process = self._start()
            answer = process.request(request, wall_s=WALL_S)
        except SubprocessDied as error:
            self._end()
            raise BadRequest(f"the preview was stopped: {error}; choose a coarser resolution or fewer views") from error
        if isinstance(answer, Failure):
            raise BadRequest(f"the preview failed: {answer.message}")
        return answer

    def _start(self) -> Subprocess:
        process = self._local.process = Subprocess("map3d.previews.view_preview:open_previewer", {}, limits=LIMITS)
        with self._lock:
            self._processes.add(process)
        process.wait_ready(START_S)
        return process

    def _end(self) -> None:
        process: Subprocess | None = getattr(self._local, "process", None)
        self._local.process = None
        if process is not None:
            with self._lock:
                self._processes.discard(process)
            process.close()


def _dump(record: RenderingRecord) -> dict[str, Any]:
    return dict(zip(RENDERING_COLUMNS, codec.dump_rendering(record), strict=True))


@lru_cache(maxsize=32)
def _box(workspace: Workspace, scene: str, built: str) -> Box:
    """`built` is a part of the key only."""
    return open_scene(workspace, scene).box
