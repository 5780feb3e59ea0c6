"""A small town of boxes as OBJ files, workspaces of it that tests copy, and the type of the `run` fixture."""

import shutil
from collections.abc import Callable
from pathlib import Path

from map3d.catalogue import Workspace
from map3d.cli import app

Run = Callable[..., tuple[int, str, str]]
"""Takes the words of a command line; returns (status, output, errors)."""


def house(x: float, y: float, height: float) -> str:
    """Returns a box of 8 × 10 m as OBJ."""
    corners = [(x + dx, y + dy, z) for z in (0.0, height) for dy in (0.0, 10.0) for dx in (0.0, 8.0)]
    faces = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (2, 4, 8, 6), (4, 3, 7, 8), (3, 1, 5, 7)]
    lines = [f"v {a} {b} {c}" for a, b, c in corners] + ["f " + " ".join(map(str, face)) for face in faces]
    return "\n".join(lines) + "\n"


def write_town(folder: Path, side: int = 4) -> Path:
    """Writes side × side houses, 40 m apart."""
    folder.mkdir(parents=True, exist_ok=True)
    for i in range(side):
        for j in range(side):
            (folder / f"house-{i}-{j}.obj").write_text(house(40.0 * i, 40.0 * j, 6.0 + (3 * i + 5 * j) % 7))
    return folder


def make_original(folder: Path, *commands: tuple[str, ...]) -> Path:
    """Runs command lines with the workspace `workspace` of the folder, which `copy_original` copies."""
    for command in commands:
        assert app.run([*command, "--workspace", str(folder / "workspace")]) == 0, command
    return folder


def copy_original(folder: Path, to: Path) -> Workspace:
    """Copies the workspace and the files beside it; returns the copy of the workspace."""
    shutil.copytree(folder, to, dirs_exist_ok=True)
    return Workspace(to / "workspace")
