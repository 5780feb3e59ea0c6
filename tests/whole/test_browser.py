"""A made-up town, imported, rendered and served by the command line; a browser clicks on buildings whose place is known."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from map3d import _core
from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.registry import Registry
from map3d.render.plan import frame_text
from map3d.town import TownSpec, make_town
from map3d.types import TileId

pytestmark = pytest.mark.browser

ROOT = Path(__file__).parents[2]
PLAYWRIGHT = ROOT / "viewer" / "node_modules" / "playwright-core"
VIEW = "90-45"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    files, root = tmp_path_factory.mktemp("files"), tmp_path_factory.mktemp("workspace")
    make_town(files, TownSpec(buildings=12, seed=5, texture_px=256, trees=False), None)
    where = ["-w", str(root)]
    for command in (
        ["create-scene", "town", *where],
        ["add-files", "town", str(files), *where],
        ["create-rendering", "town", "town", "--res", "0.4", "--directions", "4", *where],
        ["render", "town", *where],
        ["verify", "town", *where],
    ):
        assert run(command) == 0, command
    return root


@pytest.fixture(scope="module")
def origin(workspace: Path) -> Iterator[str]:
    command = [sys.executable, "-m", "map3d", "serve", "-w", str(workspace), "--port", "0"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"})
    assert server.stdout is not None
    try:
        for line in server.stdout:
            if found := re.search(r"http://\S+?(?=/?\s*$)", line):
                yield found[0].rstrip("/")
                break
        else:
            pytest.fail("the server ended without an address")
    finally:
        server.terminate()
        server.wait(20)
        server.stdout.close()


def known_buildings(workspace: Path, count: int) -> list[tuple[int, list[float], float]]:
    """(id, world position, metres a pixel) of pixels that show buildings, from the core's own G-buffers."""
    catalogue = Workspace(workspace).open_catalogue()
    record = catalogue.rendering("town")
    catalogue.close()
    frame = next(frame for frame in record.frames if frame.id == VIEW)
    text = frame_text(record, frame)
    scene = _core.Scene(str(workspace / "scenes" / "town"))
    registry = Registry(workspace / "scenes" / "town" / "registry.sqlite")
    found: dict[int, tuple[int, list[float], float]] = {}
    for y, x in np.argwhere(scene.occupied(text, frame.zmax)):
        buffer = scene.gbuffer(text, int(x), int(y))
        for number in np.unique(buffer["id"]):
            item = registry.get(int(number)) if number else None
            rows, columns = np.nonzero(buffer["id"] == number)
            if item is None or item.kind.lower() != "building" or len(rows) < 400 or int(number) in found:
                continue
            middle = np.argmin((rows - np.median(rows)) ** 2 + (columns - np.median(columns)) ** 2)
            j, i = int(rows[middle]), int(columns[middle])
            local = frame.local_from_pixel(TileId(frame.zmax, int(x), int(y)), i, j, buffer["depth"][j, i])
            found[int(number)] = (int(number), (local + scene.origin).tolist(), record.res_m)
    registry.close()
    return list(found.values())[:count]


def test_a_click_on_a_known_building_gives_its_gml_id_and_position(workspace: Path, origin: str) -> None:
    node = shutil.which("node")
    assert node, "Node.js is not there"
    assert PLAYWRIGHT.is_dir(), "make .cache/npm puts playwright-core there"
    known = known_buildings(workspace, 3)
    assert known
    picture = ROOT / "tests" / ".out" / "whole.png"
    picture.parent.mkdir(exist_ok=True)
    places = json.dumps([position for _, position, _ in known])
    command = [node, str(Path(__file__).with_name("browse.mjs")), str(PLAYWRIGHT), origin, "town", VIEW, places, str(picture)]
    answer = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=180).stdout)
    assert answer["problems"] == []
    registry = Registry(workspace / "scenes" / "town" / "registry.sqlite")
    for (number, position, res_m), click in zip(known, answer["clicks"], strict=True):
        item = registry.get(number)
        assert item is not None
        assert (click["id"], click["name"], click["approximate"]) == (number, item.name, False)
        assert np.linalg.norm(np.array(click["position"]) - position) <= 2 * res_m
    registry.close()
