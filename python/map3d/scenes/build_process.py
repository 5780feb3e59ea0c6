"""The subprocess in which a scene is built: a scene that needs more memory than allowed ends it and nothing else."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from map3d import _core, errors
from map3d.errors import LimitExceeded, Map3dError
from map3d.subprocess import Failure, Handler, Limits, ReportProgress, Subprocess

BuildProgress = Callable[[str, int, int], bool]
"""(stage, done, total) → False to stop."""

ENTRY: Final = "map3d.scenes.build_process:open_builder"
START_TIMEOUT_S: Final = 120.0
LEAST_BYTES: Final = 256 << 20
"""The interpreter, the libraries and the stacks of threads take about half of this."""
_OWN_BYTES: Final = 128 << 20


def open_builder(_setup: Mapping[str, Any]) -> Handler:
    def handle(request: dict[str, Any], _blobs: list[bytes], report_progress: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        def progress(stage: str, done: int, total: int) -> bool:
            report_progress({"stage": stage, "done": done, "total": total})
            return True

        return json.loads(_core.build_scene(request["folder"], json.dumps(request["build"]), progress)), []

    return handle


def build_in_subprocess(
    scene: str, folder: Path, request: Mapping[str, Any], max_memory_bytes: int, progress: BuildProgress | None
) -> dict[str, Any]:
    """Builds the folder of a scene and returns the report. What is finished stays when the build ends early.

    Raises LimitExceeded when it needs more than `max_memory_bytes`, `_core.Interrupted` when `progress` returns False, and the errors of the core.
    """
    if max_memory_bytes < LEAST_BYTES:
        raise errors.BadRequest(f"--max-memory is {max_memory_bytes >> 20} MiB, but a build takes at least {LEAST_BYTES >> 20} MiB")

    def show(counts: Any) -> None:
        if counts is not None and progress is not None and not progress(counts["stage"], counts["done"], counts["total"]):
            raise _core.Interrupted("interrupted; what is finished stays")

    process = Subprocess(ENTRY, {}, limits=Limits(data_bytes=max_memory_bytes))
    try:
        process.wait_ready(START_TIMEOUT_S)
        build = {**request, "max_memory_bytes": max_memory_bytes - _OWN_BYTES}
        answer = process.request({"folder": str(folder.absolute()), "build": build}, wall_s=None, on_progress=show)
    except LimitExceeded as error:
        raise LimitExceeded(
            f"scene {scene}: the build needs more memory than its limit of {max_memory_bytes >> 20:,} MiB; raise it with --max-memory, "
            "or divide the files among several scenes"
        ) from error
    finally:
        process.close()
    if isinstance(answer, Failure):
        raise _error(scene, answer)
    report: dict[str, Any] = answer.value
    return report


def _error(scene: str, failure: Failure) -> Exception:
    """Returns the exception that the subprocess raised; a limit error of the core is reported for the scene."""
    if failure.kind == "LimitError":
        return LimitExceeded(f"scene {scene}: {failure.message}; remove the files with such triangles, or leave out what is far away")
    kind = getattr(_core, failure.kind, None) or getattr(errors, failure.kind, None)
    if isinstance(kind, type) and issubclass(kind, _core.CoreError | Map3dError):
        return kind(failure.message)
    return Map3dError(f"scene {scene}: the build failed: {failure.kind}: {failure.message}")
