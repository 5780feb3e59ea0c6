"""A workspace in which operations import, build, render and publish a small town, and what must be equal at the end."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from map3d.catalogue import Catalogue, OperationRecord, OperationState, Workspace
from map3d.lifecycle.create_rendering import create_rendering
from map3d.lifecycle.create_scene import create_scene
from map3d.operations.operation_worker import OperationWorker
from map3d.operations.request_operation import request_operation
from map3d.operations.uploaded_files import uploads_folder
from map3d.requests import CreateRendering, CreateScene
from map3d.types import ViewAngles
from map3d.uploads import Uploads
from tests.cli.towns import house
from tests.operations.archives import write_zip

WAIT_S = 120.0
PAUSING = "tests.operations.pausing:open_pausing"
STARTED: list["subprocess.Popen[bytes]"] = []
"""Workers that the present test has started."""
WORKER = """
import sys
from pathlib import Path
from map3d.catalogue import Workspace
from map3d.operations.operation_worker import OperationWorker

workspace = Workspace(Path(sys.argv[1]))
OperationWorker(workspace, workspace.open_catalogue(), poll_s=0.05, heartbeat_s=0.1, entry=sys.argv[2]).run(forever=True)
"""


def town_zip(path: Path) -> Path:
    """Writes a ZIP archive with four houses, one of them with a material and a texture."""
    from io import BytesIO

    from PIL import Image

    picture = BytesIO()
    with Image.new("RGB", (16, 16), (180, 60, 40)) as image:
        image.save(picture, "PNG")
    textured = "mtllib town.mtl\nusemtl wall\n" + house(0, 0, 9) + "vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 4/3\n"
    files = {
        "houses/textured.obj": textured.encode(),
        "houses/town.mtl": b"newmtl wall\nmap_Kd tex/wall.png\n",
        "houses/tex/wall.png": picture.getvalue(),
    }
    files |= {f"houses/house-{k}.obj": house(40.0 * k, 0, 6 + k).encode() for k in range(1, 4)}
    return write_zip(path, files)


@dataclass
class Scenario:
    workspace: Workspace
    catalogue: Catalogue

    def upload(self, path: Path, name: str | None = None, user: str = "anna") -> str:
        """Stores a complete upload and returns its id."""
        uploads, data = Uploads(uploads_folder(self.workspace)), path.read_bytes()
        made = uploads.create(user, name or path.name, len(data))
        with uploads.write(made.id, user, 0) as writer:
            writer.write(data)
        return made.id

    def ask(self, kind: str, target: str = "town", **arguments: Any) -> OperationRecord:
        return request_operation(self.workspace, self.catalogue, kind, target, arguments, "anna")

    def work(self) -> None:
        """Does all waiting operations."""
        OperationWorker(self.workspace, self.catalogue, poll_s=0.05, heartbeat_s=0.1).run(forever=False)

    def do(self, kind: str, target: str = "town", **arguments: Any) -> OperationRecord:
        """Asks for an operation, does it and returns how it ended."""
        asked = self.ask(kind, target, **arguments)
        self.work()
        return self.catalogue.operation(asked.id)

    def create_rendering(self) -> None:
        request = CreateRendering(scene="town", name="town", views=(ViewAngles(0, 45),), res_m=0.1, layers=("color", "id"))
        create_rendering(self.workspace, self.catalogue, request)

    def log(self, operation: OperationRecord) -> str:
        return "\n".join(str(line.text) for line in self.catalogue.operation_log(operation.id))


def open_scenario(folder: Path, catalogue_url: str | None = None) -> Scenario:
    workspace = Workspace(folder, catalogue_url).create()
    catalogue = workspace.open_catalogue()
    if not catalogue.scenes():
        create_scene(workspace, catalogue, CreateScene(name="town"))
    return Scenario(workspace, catalogue)


def run_all(scenario: Scenario, archive: Path, interrupt: Callable[[OperationRecord], None] = lambda _: None) -> None:
    """Imports, builds, renders and publishes. `interrupt` is called with each waiting operation before a worker does it."""
    steps: list[tuple[str, Mapping[str, Any]]] = [("import", {"files": [scenario.upload(archive)]}), ("build", {}), ("render", {})]
    for kind, arguments in [*steps, ("publish", {})]:
        if kind == "render":
            scenario.create_rendering()
        asked = scenario.ask(kind, **arguments)
        interrupt(asked)
        scenario.work()
        ended = scenario.catalogue.operation(asked.id)
        assert ended.state is OperationState.DONE, f"{ended.message}\n{scenario.log(ended)}"


def published(scenario: Scenario) -> dict[str, bytes]:
    folder = scenario.workspace.root / "published" / "town"
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def files_below(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if "catalogue" not in path.name)


def start_worker(scenario: Scenario, entry: str = PAUSING) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    STARTED.append(subprocess.Popen([sys.executable, "-c", WORKER, str(scenario.workspace.root), entry], env=environment))
    return STARTED[-1]


def wait_for(condition: Callable[[], object], what: str) -> None:
    deadline = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < deadline, f"waited {WAIT_S:.0f} s for {what}"
        time.sleep(0.02)


def is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (ProcessLookupError, FileNotFoundError):
        return False


def kill(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGKILL)
    process.wait(WAIT_S)
