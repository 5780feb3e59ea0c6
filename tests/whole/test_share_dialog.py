"""A shared link opens its view, and the share dialog of a served map gives the link, the code to embed, a picture and a QR code."""

import re
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.tiles.manifest import Manifest
from tests.whole.browsing import browse, picture

pytestmark = pytest.mark.browser


@pytest.mark.parametrize(("screen", "size"), [("desk", [1280, 800]), ("phone", [390, 844])])
def test_share_dialog(workspace: Path, origin: str, screen: str, size: list[int]) -> None:
    x, y, z = Manifest.load(Workspace(workspace).manifest_path("town").read_bytes()).origin
    view = f"0-45/{x:.1f}/{y:.1f}/{z:.1f}/2.00"
    seen = browse("share_dialog.mjs", origin=origin, rendering="town", view=view, size=size, screenshot=picture(f"share-{screen}.png"))
    assert seen["problems"] == []
    assert seen["opened"].startswith(f"{origin}/view/town/#{view}")
    assert seen["link"].startswith(f"{origin}/view/town/?view={view}")
    assert seen["again"].startswith(f"{origin}/view/town/#{view}")
    assert re.fullmatch(r'<iframe src="([^"]*)" title="town" width="800" height="500" .*></iframe>', seen["embed"])[1] == seen["link"]  # type: ignore[index]
    assert seen["sizes"][0] == [1200, 630]
    assert seen["inside"]
