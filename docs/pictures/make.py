"""`python docs/pictures/make.py FOLDER`: the pictures of the documentation, from a made-up town in FOLDER. Stopped, it goes on where it was."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Final

from light import side_by_side

from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.geometry.views import uvd_from_local
from map3d.tiles.sqlite_store import SqliteTileStore

HERE: Final = Path(__file__).parent
PLAYWRIGHT: Final = HERE.parents[1] / "viewer" / "node_modules" / "playwright-core"
TITLE: Final = ("--title", "A made-up town")
LIGHT: Final = ("--res", "0.2", "--view", "30/45", "--layers", "picture,sun,ao", "--time", "2026-06-21T17:00+02:00", "--quality", "92")
VIEWS: Final = ("--view", "0/45", "--view", "120/45", "--view", "0/22.5", "--view", "0/10")


def prepare(folder: Path) -> Path:
    """The workspace with the renderings `pictures` and `light` of the town."""
    workspace = Workspace(folder / "workspace").create()
    where = ("--workspace", str(workspace.root))
    steps = [("make-town", "-o", str(folder / "town"), "--buildings", "300", "--seed", "7")]
    catalogue = workspace.open_catalogue()
    if not catalogue.scenes():
        steps += [("create-scene", "town", *TITLE, *where), ("add-files", "town", str(folder / "town"), *where)]
    if not catalogue.renderings():
        steps.append(("create-rendering", "town", "pictures", "--res", "0.1", *VIEWS, *TITLE, *where))
        steps.append(("create-rendering", "town", "light", *LIGHT, *TITLE, *where))
    catalogue.close()
    for step in [*steps, ("render", "pictures", *where), ("render", "light", *where)]:
        status = run(list(step))
        if status:
            sys.exit(status)
    return workspace.root


def light(workspace: Path) -> None:
    """The layers of light around the middle of the town."""
    catalogue = Workspace(workspace).open_catalogue()
    frame = catalogue.rendering("light").frames[0]
    catalogue.close()
    # The origin of a scene lies near its middle: here the church square.
    u, v = uvd_from_local(frame.axes, (0.0, 0.0, 0.0))[:2]
    pixel_m = frame.pixel_m(frame.zmax)
    with SqliteTileStore(Workspace(workspace).store_path("light", frame.id), read_only=True) as store:
        side_by_side(store, (round((u - frame.u0_m) / pixel_m), round((frame.v0_m - v) / pixel_m)), HERE / "light.jpg")


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
    root = prepare(Path(sys.argv[1]))
    light(root)
    shoot(root)
