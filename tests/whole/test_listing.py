"""Listing 1 of the paper (Christen & Nebiker 2015), unchanged, on the teatime scene: four tile hosts, two markers, no options."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image

from map3d.cli.app import run
from map3d.registry import Registry
from map3d.tiles.viewer_files import viewer_folder
from tests.publish.hosts import static_host
from tests.whole.browsing import browse, picture, served

pytestmark = pytest.mark.browser

TILE_HOSTS = [f"t{number}.3dmaps.ch" for number in (1, 2, 3, 4)]
BODY, CUBE_TOP, GROUND = [0.0, 0.0, 18.0], [80.5, 11.5, 21.0], [45.0, -20.0, 0.0]
"""Inside the teapot's body; on the cube; on the ground next to both."""


@pytest.fixture(scope="module")
def teatime(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace with the rendering `teatime`."""
    files, root = tmp_path_factory.mktemp("files"), tmp_path_factory.mktemp("workspace")
    where = ["-w", str(root)]
    for command in (
        ["teatime", "-o", str(files)],
        ["create-scene", "teatime", *where],
        ["add-files", "teatime", str(files), *where],
        ["create-rendering", "teatime", "teatime", "--view", "45/22.5", "--res", "0.1", *where],
        ["render", "teatime", *where],
    ):
        assert run(command) == 0, command
    return root


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Serves the page with the listing; yields host and port."""
    folder = tmp_path_factory.mktemp("page")
    shutil.copy(Path(__file__).with_name("listing.html"), folder)
    shutil.copy(viewer_folder() / "map3d.js", folder)
    with static_host(folder) as address:
        yield urlsplit(address).netloc


def test_listing_of_the_paper_runs_unchanged(teatime: Path, page: str) -> None:
    shot = picture("listing.png")
    with served(teatime) as origin:
        hosts = {"www.3dmaps.ch": page} | dict.fromkeys(TILE_HOSTS, urlsplit(origin).netloc)
        answer = browse("listing.mjs", hosts=hosts, page="http://www.3dmaps.ch/listing.html", picture=shot, positions=[BODY, CUBE_TOP, GROUND])
    assert answer["problems"] == []
    assert sorted(answer["hosts"]) == TILE_HOSTS
    assert sorted(answer["markers"]) == ["Green Cube", "Green Teapot"]
    pixels = np.asarray(Image.open(shot).convert("RGB")).astype(int)
    teapot, cube, ground = (pixels[round(y) + 3, round(x) + 3] for x, y in answer["points"])
    assert teapot[1] > 1.4 * max(teapot[0], teapot[2]), "the teapot is green"
    assert cube[1] > cube[0] > 1.2 * cube[2], "the cube is a yellower green"
    assert np.ptp(ground) < 30, "the ground is grey"
    on_teapot, on_cube, on_ground = answer["clicks"]
    with Registry(teatime / "scenes" / "teatime" / "registry.sqlite") as registry:
        ids = {item.name: item.id for item in registry.objects()}
    assert (on_teapot["id"], on_teapot["name"], on_teapot["approximate"]) == (ids["teapot"], "teapot", False)
    assert (on_cube["id"], on_cube["name"]) == (ids["cube"], "cube")
    assert np.abs(np.array(on_cube["position"]) - CUBE_TOP).max() < 0.3
    assert on_ground["id"] not in (ids["teapot"], ids["cube"])
