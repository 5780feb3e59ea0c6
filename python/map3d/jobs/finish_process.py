"""A subprocess that writes the manifest of a rendering: that takes long for a large one, and the server must answer meanwhile."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from map3d.catalogue import State, Workspace
from map3d.errors import SubprocessDied
from map3d.jobs.finish import finish
from map3d.subprocess import Failure, Handler, ReportProgress, Subprocess

ENTRY: Final = "map3d.jobs.finish_process:open_finisher"
START_S: Final = 60.0
WALL_S: Final = 3600.0
_ATTEMPTS: Final = 3


def finish_in_subprocess(workspace: Workspace, rendering: str) -> None:
    """Writes the manifest of the rendering's present state. Raises SubprocessDied."""
    process = Subprocess(ENTRY, {"workspace": str(workspace.root.absolute()), "catalogue": workspace.catalogue_url})
    try:
        process.wait_ready(START_S)
        answer = process.request({"rendering": rendering}, wall_s=WALL_S)
        if isinstance(answer, Failure):
            raise SubprocessDied(f"rendering {rendering}: cannot write the manifest: {answer.kind}: {answer.message}")
    finally:
        process.close()


def open_finisher(setup: Mapping[str, Any]) -> Handler:
    """`setup`: {"workspace": folder, "catalogue": URL or None}; a request is {"rendering": name}."""
    workspace = Workspace(Path(setup["workspace"]), setup["catalogue"])
    catalogue = workspace.open_catalogue()

    def handle(request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], Sequence[bytes]]:
        """Writes it again when the last job was done meanwhile, so that the manifest of a complete rendering says so."""
        name = request["rendering"]
        for _ in range(_ATTEMPTS):
            complete = finish(workspace, catalogue, name)
            counts = catalogue.count_jobs(name)
            if complete == (counts[State.DONE] == sum(counts.values())):
                break
        return {"complete": complete}, []

    return handle
