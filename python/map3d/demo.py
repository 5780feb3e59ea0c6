"""`python -m map3d.demo FOLDER`: makes a town, renders it in four directions and serves it on a free port. Stopped, it goes on where it was."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from map3d.catalogue import Workspace
from map3d.cli.app import run

TOWN: Final = ("--buildings", "120", "--seed", "7")
RES_M: Final = "0.15"
TITLE: Final = ("--title", "A made-up town")


def steps(folder: Path) -> Iterator[list[str]]:
    """The command lines, in order; what an earlier run has done is left out."""
    workspace = Workspace(folder / "workspace").create()
    where = ["--workspace", str(workspace.root)]
    yield ["make-town", "-o", str(folder / "town"), *TOWN]
    catalogue = workspace.open_catalogue()
    scenes = {scene.name: catalogue.assets(scene.name) for scene in catalogue.scenes()}
    renderings = {rendering.name for rendering in catalogue.renderings()}
    catalogue.close()
    if "town" not in scenes:
        yield ["create-scene", "town", *TITLE, *where]
    if not scenes.get("town"):
        yield ["add-files", "town", str(folder / "town"), *where]
    if "demo" not in renderings:
        yield ["create-rendering", "town", "demo", "--directions", "4", "--res", RES_M, *TITLE, *where]
    yield ["render", "demo", *where]
    yield ["serve", "--port", "0", *where]


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit("usage: python -m map3d.demo FOLDER")
    for step in steps(Path(sys.argv[1])):
        print("map3d", *step, flush=True)
        status = run(step)
        if status:
            sys.exit(status)


if __name__ == "__main__":
    main()
