"""`python docs/pictures/make.py FOLDER`: makes the images of the documentation from a generated town in FOLDER. Re-run it to resume.

CesiumJS and the converters of its tiles are npm packages in bench/viewer; without them it skips the images with CesiumJS and prints a warning.
"""

import json
import os
import re
import secrets
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from PIL import Image

sys.path.append(str(Path(__file__).parents[2]))

from bench.viewer import peers_installed
from light_panels import draw_panels
from sheet import sheet
from town3d import town_tileset

from map3d.accounts import Accounts
from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.geometry.views import uvd_from_local
from map3d.tiles.sqlite_store import SqliteTileStore

HERE: Final = Path(__file__).parent
ROOT: Final = HERE.parents[1]
PLAYWRIGHT: Final = ROOT / "viewer" / "node_modules" / "playwright-core"
CESIUM: Final = ROOT / "bench" / "viewer" / "node_modules" / "cesium" / "package.json"
TITLE: Final = ("--title", "A made-up town")
LIGHT: Final = ("--res", "0.2", "--view", "30/45", "--layers", "picture,sun,ao", "--time", "2026-06-21T17:00+02:00", "--quality", "92")
VIEWS: Final = ("--view", "0/45", "--view", "120/45", "--view", "0/22.5", "--view", "0/10", "--view", "0/90")
QUALITY: Final = 80
PHONE_PX: Final = 780
"""Width of a phone's image: two pixels per CSS pixel, reduced from three."""


def prepare(folder: Path) -> Path:
    """Renders `pictures` and `light` of the town; returns the workspace."""
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


def draw_light_panels(workspace: Path) -> None:
    """Draws the light layers around the centre of the town."""
    catalogue = Workspace(workspace).open_catalogue()
    frame = catalogue.rendering("light").frames[0]
    catalogue.close()
    # The origin of the scene is near its centre, the market square.
    u, v = uvd_from_local(frame.axes, (0.0, 0.0, 0.0))[:2]
    pixel_m = frame.pixel_m(frame.zmax)
    with SqliteTileStore(Workspace(workspace).store_path("light", frame.id), read_only=True) as store:
        draw_panels(store, (round((u - frame.u0_m) / pixel_m), round((frame.v0_m - v) / pixel_m)), HERE / "light.jpg")


def shoot(workspace: Path, views: list[dict[str, Any]], cesium: Path | None, out: Path) -> None:
    """Writes the missing PNG files of the views into `out`, by map3d.js and, with a folder of 3D Tiles, by CesiumJS."""
    out.mkdir(parents=True, exist_ok=True)
    with serving(workspace) as address:
        where = {"playwright": str(PLAYWRIGHT), "page": f"{address}/view/pictures/", "cesium": cesium and str(cesium), "out": str(out)}
        subprocess.run(["node", str(HERE / "shoot.mjs")], input=json.dumps({"views": views, **where}), text=True, check=True)


@contextmanager
def serving(workspace: Path) -> Iterator[str]:
    """Serves a workspace; yields the address, without a slash at its end."""
    command = [sys.executable, "-m", "map3d", "serve", "--workspace", str(workspace), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}) as server:
        assert server.stdout is not None
        try:
            address = next((found[0] for line in server.stdout if (found := re.search(r"http://[^\s/]+", line))), None)
            if address is None:
                sys.exit("the server exited without printing an address")
            yield address
        finally:
            server.terminate()


def shoot_studio(folder: Path) -> None:
    """Writes the images of the web interface, which imports, renders and publishes a small town in a workspace of its own."""
    town, shots = folder / "small-town", folder / "studio-shots"
    if status := run(["make-town", "-o", str(town), "--buildings", "40", "--seed", "7"]):
        sys.exit(status)
    archive = shutil.make_archive(str(folder / "old-town"), "zip", town)
    workspace = Workspace(folder / "studio").create()
    password = secrets.token_urlsafe()
    try:
        with workspace.open_catalogue() as catalogue:
            Accounts(catalogue).add_user("anna", password, "editor")
        shots.mkdir(exist_ok=True)
        with serving(workspace.root) as address:
            where = {"playwright": str(PLAYWRIGHT), "address": address, "archive": archive, "out": str(shots)}
            who = {"user": "anna", "password": password, "title": "Old town"}
            subprocess.run(["node", str(HERE / "studio.mjs")], input=json.dumps({**where, **who}), text=True, check=True)
        for path in sorted(shots.glob("*.png")):
            with Image.open(path) as shot:
                shot.convert("RGB").save(HERE / f"{path.stem}.jpg", quality=QUALITY)
    finally:
        shutil.rmtree(workspace.root)
        shutil.rmtree(shots, ignore_errors=True)


def draw_beside_cesium(view: dict[str, Any], shots: Path) -> None:
    """Draws a JPEG of map3d.js, left, and CesiumJS."""
    panels, captions = [], []
    for viewer, title in (("map3d", "map3d.js"), ("cesium", f"CesiumJS {json.loads(CESIUM.read_text())['version']}")):
        with Image.open(shots / f"{view['name']}-{viewer}.png") as shot:
            panel = shot.convert("RGB")
        if "dpr" in view:
            panel = panel.resize((PHONE_PX, PHONE_PX * panel.height // panel.width), Image.Resampling.LANCZOS)
        panels.append(panel)
        facts = json.loads((shots / f"{view['name']}-{viewer}.json").read_text())
        drawn = f", {facts['triangles']:,} triangles drawn" if "triangles" in facts else ""
        captions.append(f"{title}: {facts['bytes'] / 1e6:.1f} MB fetched{drawn}")
    sheet(panels, captions).save(HERE / f"{view['name']}.jpg", quality=QUALITY)


def main(folder: Path) -> None:
    workspace = prepare(folder)
    draw_light_panels(workspace)
    views = json.loads((HERE / "views.json").read_text())
    with_cesium = peers_installed()
    if with_cesium:
        town_tileset(Workspace(workspace), "town", folder)
    else:
        print("docs: skipped the images with CesiumJS", file=sys.stderr)
        views = [view for view in views if view.get("alone")]
    shots = folder / "shots"
    shoot(workspace, views, folder.absolute() if with_cesium else None, shots.absolute())
    for view in views:
        if view.get("alone"):
            with Image.open(shots / f"{view['name']}-map3d.png") as shot:
                shot.convert("RGB").save(HERE / f"{view['name']}.jpg", quality=QUALITY)
        else:
            draw_beside_cesium(view, shots)
    # The next run takes all screenshots again.
    shutil.rmtree(shots)
    shoot_studio(folder.absolute())


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python docs/pictures/make.py FOLDER")
    main(Path(sys.argv[1]))
