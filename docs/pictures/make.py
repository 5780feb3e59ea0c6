"""`python docs/pictures/make.py FOLDER`: makes the pictures of the documentation from a generated town in FOLDER. Re-run it to resume.

CesiumJS and the converter for its tiles are npm packages in bench/viewer. Without them, the pictures that show CesiumJS are kept, with a message.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

from PIL import Image

sys.path.append(str(Path(__file__).parents[2]))

from bench.viewer import peers
from light import side_by_side
from sheet import sheet
from town3d import town_tileset

from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.geometry.views import uvd_from_local
from map3d.tiles.sqlite_store import SqliteTileStore

HERE: Final = Path(__file__).parent
ROOT: Final = HERE.parents[1]
PLAYWRIGHT: Final = ROOT / "viewer" / "node_modules" / "playwright-core"
CESIUM: Final = ROOT / "bench" / "viewer" / "node_modules" / "cesium" / "package.json"
TITLE: Final = ("--title", "A generated town")
LIGHT: Final = ("--res", "0.2", "--view", "30/45", "--layers", "picture,sun,ao", "--time", "2026-06-21T17:00+02:00", "--quality", "92")
VIEWS: Final = ("--view", "0/45", "--view", "120/45", "--view", "0/22.5", "--view", "0/10", "--view", "0/90")
QUALITY: Final = 80
PHONE_PX: Final = 780
"""Phone screenshots have three pixels per CSS pixel and are scaled to two."""


def prepare(folder: Path) -> Path:
    """Returns the workspace with the renderings `pictures` and `light` of the town."""
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
    """Makes light.jpg: the light layers around the centre of the town."""
    catalogue = Workspace(workspace).open_catalogue()
    frame = catalogue.rendering("light").frames[0]
    catalogue.close()
    # The origin of a scene is near its centre: here the church square.
    u, v = uvd_from_local(frame.axes, (0.0, 0.0, 0.0))[:2]
    pixel_m = frame.pixel_m(frame.zmax)
    with SqliteTileStore(Workspace(workspace).store_path("light", frame.id), read_only=True) as store:
        side_by_side(store, (round((u - frame.u0_m) / pixel_m), round((frame.v0_m - v) / pixel_m)), HERE / "light.jpg")


def shoot(workspace: Path, views: list[dict[str, Any]], cesium: Path | None, out: Path) -> None:
    """Takes missing screenshots of the views in map3d.js and, given a folder with the town's 3D Tiles, in CesiumJS. Writes PNG files to `out`."""
    out.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "map3d", "serve", "--workspace", str(workspace), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}) as server:
        assert server.stdout is not None
        try:
            address = next((found[0] for line in server.stdout if (found := re.search(r"http://[^\s/]+", line))), None)
            if address is None:
                sys.exit("the server ended without an address")
            where = {"playwright": str(PLAYWRIGHT), "page": f"{address}/view/pictures/", "cesium": cesium and str(cesium), "out": str(out)}
            subprocess.run(["node", str(HERE / "shoot.mjs")], input=json.dumps({"views": views, **where}), text=True, check=True)
        finally:
            server.terminate()


def beside(view: dict[str, Any], shots: Path) -> None:
    """Makes a JPEG with map3d.js on the left and CesiumJS on the right."""
    panels, words = [], []
    for viewer, title in (("map3d", "map3d.js"), ("cesium", f"CesiumJS {json.loads(CESIUM.read_text())['version']}")):
        with Image.open(shots / f"{view['name']}-{viewer}.png") as shot:
            panel = shot.convert("RGB")
        if "dpr" in view:
            panel = panel.resize((PHONE_PX, PHONE_PX * panel.height // panel.width), Image.Resampling.LANCZOS)
        panels.append(panel)
        told = json.loads((shots / f"{view['name']}-{viewer}.json").read_text())
        drawn = f", {told['triangles']:,} triangles drawn" if "triangles" in told else ""
        words.append(f"{title}: {told['bytes'] / 1e6:.1f} MB fetched{drawn}")
    sheet(panels, words).save(HERE / f"{view['name']}.jpg", quality=QUALITY)


def main(folder: Path) -> None:
    workspace = prepare(folder)
    light(workspace)
    views = json.loads((HERE / "views.json").read_text())
    with_cesium = peers()
    if with_cesium:
        town_tileset(Workspace(workspace), "town", folder)
    else:
        print("docs: CesiumJS is not installed; its pictures are kept", file=sys.stderr)
        views = [view for view in views if view.get("alone")]
    shots = folder / "shots"
    shoot(workspace, views, folder.absolute() if with_cesium else None, shots.absolute())
    for view in views:
        if view.get("alone"):
            with Image.open(shots / f"{view['name']}-map3d.png") as shot:
                shot.convert("RGB").save(HERE / f"{view['name']}.jpg", quality=QUALITY)
        else:
            beside(view, shots)
    # The next run takes all of them again.
    shutil.rmtree(shots)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python docs/pictures/make.py FOLDER")
    main(Path(sys.argv[1]))
