"""Estimates a rendering in a subprocess, for a server that never computes: it plans, and renders some blocks as a sample."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from map3d import errors
from map3d.catalogue import Workspace
from map3d.cores import usable_cores
from map3d.errors import Map3dError
from map3d.renderings.cost_estimate import RenderingEstimate, estimate
from map3d.subprocess import Failure, Handler, Subprocess

ESTIMATE_S: Final = 120.0
_START_S: Final = 60.0


def estimate_apart(workspace: Workspace, rendering: str, workers: int | None = None) -> RenderingEstimate:
    """Returns the estimate for `workers` processes, one per core by default. Raises the errors of `estimate`, SubprocessTimedOut."""
    process = Subprocess(f"{__name__}:open_estimator", {"workspace": str(workspace.root.absolute()), "catalogue": workspace.catalogue_url})
    try:
        process.wait_ready(_START_S)
        answer = process.request({"rendering": rendering, "workers": workers or usable_cores()}, wall_s=ESTIMATE_S)
    finally:
        process.close()
    if isinstance(answer, Failure):
        kind = getattr(errors, answer.kind, None)
        raise (kind if isinstance(kind, type) and issubclass(kind, Map3dError) else Map3dError)(answer.message)
    return RenderingEstimate(**answer.value)


def open_estimator(setup: dict[str, Any]) -> Handler:
    """Returns the handler of the subprocess."""
    workspace = Workspace(Path(setup["workspace"]), setup["catalogue"])

    def handle(request: dict[str, Any], _blobs: list[bytes], _report: Callable[[Any], None]) -> tuple[dict[str, Any], Sequence[bytes]]:
        with workspace.open_catalogue() as catalogue:
            return asdict(estimate(workspace, catalogue, request["rendering"], request["workers"])), []

    return handle
