"""A disk that fills up during a render: the render ends with a clear error, and with free space it resumes to the same tiles."""

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from map3d.catalogue import Workspace
from tests.faults.processes import Command
from tests.faults.street import RENDERING, Expected, make_workspace, read_result, render_undisturbed

STEP_BYTES: Final = 192 << 10
ENOUGH_BYTES: Final = 512 << 20
RENDER_S: Final = 120


@dataclass
class DiskReport:
    """`failed`: number of sizes at which the disk was full; `completed`: at which it sufficed."""

    failed: int = 0
    completed: int = 0
    faults: list[str] = field(default_factory=list)


def run_disk_full(sizes: int, houses: int = 24, show: bool = True) -> DiskReport:
    """Renders on a disk that has 1, 2, … steps more space than the workspace needs before the render."""
    report = DiskReport()
    with tempfile.TemporaryDirectory(prefix="map3d-disk-") as folder:
        template = make_workspace(Path(folder) / "template", houses)
        reference = Workspace(Path(folder) / "reference")
        shutil.copytree(template.root, reference.root)
        expected = render_undisturbed(reference)
        used = sum(path.stat().st_blocks * 512 for path in template.root.rglob("*"))
        for number in range(1, sizes + 1):
            _fill(template, Path(folder) / "disk", used + number * STEP_BYTES, expected, report)
        if show:
            print(f"full disk: {report.failed} renders failed and resumed, {report.completed} had enough space, {len(report.faults)} faults")
    return report


def can_mount() -> bool:
    """Whether this user may mount a small disk in memory."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            with _disk(Path(folder), 1 << 20):
                return True
        except (OSError, subprocess.CalledProcessError):
            return False


def _fill(template: Workspace, folder: Path, size_bytes: int, expected: Expected, report: DiskReport) -> None:
    folder.mkdir(exist_ok=True)
    with _disk(folder, size_bytes):
        root = folder / "workspace"
        shutil.copytree(template.root, root)
        render = Command("render", ["render", RENDERING, "--workers", "2", "-w", root])
        render.start()
        status, output = render.wait(RENDER_S), render.output()
        if status == 0:
            report.completed += 1
        else:
            report.failed += 1
            if "Traceback" in output or not any(text in output for text in ("disk is full", "No space left", "disk I/O error")):
                report.faults.append(f"{size_bytes:,} bytes: status {status} without a clear error: {output}")
            subprocess.run(["mount", "-o", f"remount,size={ENOUGH_BYTES}", str(folder)], check=True, capture_output=True)
            render.start()
            if render.wait(RENDER_S):
                report.faults.append(f"{size_bytes:,} bytes: with free space: {render.output()}")
        render.end()
        if read_result(Workspace(root)).digest != expected.digest:
            report.faults.append(f"{size_bytes:,} bytes: other tiles than without the fault")


@contextmanager
def _disk(folder: Path, size_bytes: int) -> Iterator[None]:
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_bytes}", "map3d-faults", str(folder)], check=True, capture_output=True)
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True, capture_output=True)
