"""The subprocess of an operation that pauses at a point, where the test kills it, or crashes there.

MAP3D_TEST_POINT names the point: the beginning of a stage, or the name of a function that a removal calls. MAP3D_TEST_REACHED is the file that says
that the point was reached; it has the process id.
"""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from map3d.lifecycle import remove_rendering, remove_scene
from map3d.messages import Message
from map3d.operations import do_operation
from map3d.operations.operation_report import OperationReport
from map3d.subprocess import Handler


def open_pausing(setup: dict[str, Any]) -> Handler:
    stage, _, done = os.environ["MAP3D_TEST_POINT"].partition("@")
    progress = OperationReport.progress

    def pausing_progress(self: OperationReport, stage_now: Message, now: int = 0, total: int = 0) -> None:
        progress(self, stage_now, now, total)
        if str(stage_now).startswith(stage) and now >= int(done or 0):
            self.flush()
            reach()

    OperationReport.progress = pausing_progress  # type: ignore[method-assign]
    for module in (remove_scene, remove_rendering):
        module.remove_folder = _before(stage == "remove_folder", module.remove_folder)
    return do_operation.open_operation(setup)


def _before(pauses: bool, function: Callable[[Path], None]) -> Callable[[Path], None]:
    def paused(folder: Path) -> None:
        reach()
        function(folder)

    return paused if pauses else function


def reach() -> None:
    """Pauses until the process is killed, or crashes."""
    path = Path(os.environ["MAP3D_TEST_REACHED"])
    path.with_suffix(".new").write_text(str(os.getpid()))
    path.with_suffix(".new").rename(path)
    if "MAP3D_TEST_CRASH" in os.environ:
        os.kill(os.getpid(), signal.SIGSEGV)
    time.sleep(600)
