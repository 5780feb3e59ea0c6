"""The list of renderings in a browser."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from map3d.catalogue import Workspace
from map3d.cli.app import run
from tests.whole.browsing import browse, picture, served

pytestmark = pytest.mark.browser

WINDOWS = {"desktop": (1280, 800), "phone": (390, 844)}


@pytest.fixture(scope="module")
def two_renderings(workspace: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the town's workspace with a second rendering that has no tiles."""
    root = tmp_path_factory.mktemp("two") / "workspace"
    shutil.copytree(workspace, root)
    assert run(["create-rendering", "town", "new", "--res", "0.8", "--directions", "1", "-w", str(root)]) == 0
    return root


@pytest.mark.parametrize("window", WINDOWS)
def test_the_list_shows_previews_without_errors(two_renderings: Path, window: str) -> None:
    pictures = {scheme: picture(f"renderings-{window}-{scheme}.png") for scheme in ("light", "dark")}
    with served(two_renderings) as origin:
        found = browse("renderings_page.mjs", origin=origin, path="/", size=WINDOWS[window], pictures=pictures)
    assert (found["problems"], found["requests"], found["overflow"]) == ([], [], False)
    assert (found["url"], found["titles"]) == ("/", ["town", "new"])
    assert found["images"] == [True], "of the rendering that has tiles"
    light, dark = (np.asarray(Image.open(name).convert("L")).astype(int) for name in pictures.values())
    assert light[-1, 0] > 200 > 60 > dark[-1, 0], "the page follows the colour scheme"
    assert np.abs(light - dark)[150:200, 60:200].max() < 10, "the preview is the same in both schemes"


def test_home_opens_the_only_map(workspace: Path) -> None:
    catalogue = Workspace(workspace).open_catalogue()
    assert len(catalogue.renderings()) == 1
    catalogue.close()
    with served(workspace) as origin:
        found = browse("renderings_page.mjs", origin=origin, path="/", size=WINDOWS["desktop"], pictures={"light": picture("home.png")})
    assert (found["url"], found["problems"], found["requests"]) == ("/view/town/", [], [])
