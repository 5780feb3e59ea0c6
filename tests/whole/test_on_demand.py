"""A map of which no block is rendered, opened in a browser: what is looked at is rendered meanwhile."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageChops

from map3d.catalogue import State, Workspace
from map3d.cli.app import run
from tests.whole.browsing import browse, picture, served

pytestmark = pytest.mark.browser

SIZE = [900, 640]


def states(workspace: Path, rendering: str) -> dict[State, int]:
    catalogue = Workspace(workspace).open_catalogue()
    try:
        return catalogue.count_jobs(rendering)
    finally:
        catalogue.close()


@pytest.fixture
def copied(workspace: Path, tmp_path: Path) -> Path:
    """A copy, since other tests count the renderings of the common workspace."""
    return shutil.copytree(workspace, tmp_path / "workspace")


def test_a_map_is_rendered_while_it_is_looked_at(copied: Path, origin: str) -> None:
    where = ["-w", str(copied)]
    assert run(["create-rendering", "town", "looked-at", "--res", "0.4", "--directions", "4", *where]) == 0
    assert run(["render", "looked-at", "--plan-only", *where]) == 0
    assert states(copied, "looked-at")[State.DONE] == 0
    with served(copied, "--on-demand", "--processes", "2") as address:
        asked = browse("on_demand.mjs", address=f"{address}/view/looked-at/", picture=picture("on-demand.png"), size=SIZE)
    assert asked["problems"] == []
    assert set(asked["statuses"]) == {"200"}
    jobs = states(copied, "looked-at")
    assert 0 < jobs[State.DONE] < sum(jobs.values()), "only the view that the page shows"
    rendered = browse("on_demand.mjs", address=f"{origin}/view/town/", picture=picture("rendered.png"), size=SIZE)
    assert rendered["problems"] == []
    assert difference("on-demand.png", "rendered.png") < 0.01


def difference(a: str, b: str) -> float:
    """Returns the share of pixels below the panel with the name of the rendering that differ."""
    with Image.open(picture(a)) as first, Image.open(picture(b)) as second:
        below = (0, 180, *first.size)
        pixels = np.asarray(ImageChops.difference(first.convert("RGB").crop(below), second.convert("RGB").crop(below)))
    return float((pixels.max(axis=2) > 8).mean())
