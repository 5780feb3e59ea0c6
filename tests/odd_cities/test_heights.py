"""What heights refer to is known from the file's CRS to the manifest: a vertical CRS, the ellipsoid, or unknown."""

import json
import re
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from tests.cli.towns import Run
from tests.odd_cities.towns import MUNICH, at, write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

DHHN2016 = ("geoid", 7837, "DHHN2016 height", "DHHN2016 height (EPSG:7837)")


@pytest.mark.parametrize(
    ("label", "numbers", "heights", "epsg", "vertical", "said"),
    [
        ("EPSG:25832+7837", ("EPSG:25832", (0, 1, 2)), *DHHN2016),
        ("urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH", ("EPSG:25832", (0, 1, 2)), *DHHN2016),
        ("EPSG:4979", ("EPSG:4326", (1, 0, 2)), "ellipsoid", None, "ellipsoidal height (WGS 84)", "ellipsoidal height (WGS 84)"),
        ("EPSG:25832", ("EPSG:25832", (0, 1, 2)), "unknown", None, None, "of an unknown height system"),
    ],
)
def test_the_manifest_states_what_heights_refer_to(
    tmp_path: Path,
    run: Run,
    label: str,
    numbers: tuple[str, tuple[int, int, int]],
    heights: str,
    epsg: int | None,
    vertical: str | None,
    said: str,
) -> None:
    crs, order = numbers
    write_citygml(tmp_path / "town.gml", label, at(*MUNICH, crs, order), side=2)
    assert run("create-scene", "town")[0] == 0
    assert run("add-files", "town", "town.gml")[0] == 0
    assert f"heights: {said}\n" in run("show", "scene", "town")[1]
    for files in (["town.gml"], ["town.gml", "town.gml"]):
        status, out, _ = run("inspect", *files)
        assert status == 0
        assert re.search(rf"heights +{re.escape(said)}", out)
    status, _, err = run("create-rendering", "town", "town", "--res", "2", "--view", "0-90")
    assert status == 0, err
    assert run("render", "town", "--workers", "1")[0] == 0
    manifest = json.loads(Workspace(tmp_path / "workspace").manifest_path("town").read_text())
    assert {key: manifest["crs"][key] for key in ("heights", "vertical_epsg", "vertical")} == {
        "heights": heights,
        "vertical_epsg": epsg,
        "vertical": vertical,
    }
