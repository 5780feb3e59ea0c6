"""`python docs/pictures/make.py FOLDER`: the pictures of the documentation, from a made-up town in FOLDER. Stopped, it goes on where it was."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Final

from map3d.catalogue import Workspace
from map3d.cli.app import run

HERE: Final = Path(__file__).parent
PLAYWRIGHT: Final = HERE.parents[1] / "viewer" / "node_modules" / "playwright-core"
TITLE: Final = ("--title", "A made-up town")
VIEWS: Final = ("--view", "0/45", "--view", "120/45", "--view", "0/22.5", "--view", "0/10")


def prepare(folder: Path) -> Path:
    """The workspace with the rendering `pictures` of the town."""
    workspace = Workspace(folder / "workspace").create()
    where = ("--workspace", str(workspace.root))
    steps = [("make-town", "-o", str(folder / "town"), "--buildings", "300", "--seed", "7")]
    catalogue = workspace.open_catalogue()
    if not catalogue.scenes():
        steps += [("create-scene", "town", *TITLE, *where), ("add-files", "town", str(folder / "town"), *where)]
    if not catalogue.renderings():
        steps.append(("create-rendering", "town", "pictures", "--res", "0.1", *VIEWS, *TITLE, *where))
    catalogue.close()
    for step in [*steps, ("render", "pictures", *where)]:
        status = run(list(step))
        if status:
            sys.exit(status)
    return workspace.root


def shoot(workspace: Path) -> None:
    command = [sys.executable, "-m", "map3d", "serve", "--workspace", str(workspace), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}) as server:
        assert server.stdout is not None
        try:
            address = next((found[0] for line in server.stdout if (found := re.search(r"http://[^\s/]+", line))), None)
            if address is None:
                sys.exit("the server ended without an address")
            shot = ["node", str(HERE / "shoot.mjs"), str(PLAYWRIGHT), f"{address}/view/pictures/", str(HERE / "views.json"), str(HERE)]
            subprocess.run(shot, check=True)
        finally:
            server.terminate()


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python docs/pictures/make.py FOLDER")
    shoot(prepare(Path(sys.argv[1])))
