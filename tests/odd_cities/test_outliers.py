"""One stray polygon, building or file does not cost the city: it is left out with a warning, or kept on request, within the memory limit."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from map3d.catalogue import Workspace
from map3d.registry import Registry
from map3d.scenes.build import open_scene
from map3d.scenes.outliers import read_outliers
from tests.cli.towns import Run
from tests.odd_cities import strays
from tests.odd_cities.towns import MUNICH, at, world_boxes, write_citygml

pytestmark = pytest.mark.whole


class Site:
    """Imports and builds an odd town on the command line."""

    def __init__(self, run: Run, folder: Path) -> None:
        self.run, self.folder, self.workspace = run, folder, Workspace(folder / "workspace")

    def make(self, town: Callable[[Path], Path], *options: str) -> tuple[str, dict[str, Any]]:
        """Returns what the build said, and its index."""
        self.call("create-scene", "town")
        self.call("add-files", "town", str(town(self.folder / "files")))
        return self.build("view", *options)

    def build(self, name: str, *options: str) -> tuple[str, dict[str, Any]]:
        _, _, err = self.call("create-rendering", "town", name, "--res", "1", "--view", "0-45", *options)
        return err, json.loads((self.workspace.scene_folder("town") / "scene.json").read_text())

    def call(self, *words: str) -> tuple[int, str, str]:
        status, out, err = self.run(*words)
        assert status == 0, err
        return status, out, err

    def extent_m(self) -> tuple[float, float, float]:
        low, high = open_scene(self.workspace, "town").box
        return high[0] - low[0], high[1] - low[1], high[2] - low[2]

    def names(self) -> set[str]:
        with Registry(self.workspace.registry_path("town")) as registry:
            return {item.name for item in registry.objects() if item.kind != "terrain"}


@pytest.fixture
def site(run: Run, tmp_path: Path) -> Site:
    return Site(run, tmp_path)


def test_polygon_at_0_0_0_is_left_out_of_its_building(site: Site) -> None:
    err, index = site.make(strays.polygon_at_0_0_0)
    assert "left out 1 triangle of 1 object, far from the rest:" in err
    assert "town.gml: 1 triangle, up to 5,33" in err
    assert "house-1-2 (in part)" in err
    assert "--keep-outliers keeps everything" in err
    assert "(options of map3d site and create-rendering)\n" in err
    assert max(site.extent_m()) < 300
    assert index["report"]["ground_plane_triangles"] == 2
    box = world_boxes(site.workspace, "town")["house-1-2"]
    assert box[1][0] - box[0][0] < 20, "the building's box is that of what is drawn"
    assert len(site.names()) == 16


def test_polygon_that_reaches_to_0_0_0_is_left_out(site: Site) -> None:
    err, _ = site.make(strays.corner_at_0_0_0)
    assert "left out 1 triangle of 1 object" in err
    assert "house-1-2 (in part)" in err
    assert max(site.extent_m()) < 300


def test_building_of_another_zone_is_left_out_and_kept_on_request(site: Site) -> None:
    err, _ = site.make(strays.building_of_another_zone)
    assert "other.gml: 12 triangles, up to 4" in err
    assert "other-house-0-0" in err
    assert "in part" not in err
    assert max(site.extent_m()) < 300
    assert "other-house-0-0" not in site.names()
    err, index = site.build("whole", "--keep-outliers")
    assert "all of which are kept" in err
    assert site.extent_m()[0] > 400_000
    assert len(index["chunks"]) < 20, "the ground is only where content is"
    assert len(site.names()) == 17
    err, _ = site.build("again", "--no-keep-outliers")
    assert max(site.extent_m()) < 300
    assert len(site.names()) == 16


def test_far_files_are_places_of_which_one_is_built(site: Site) -> None:
    err, _ = site.make(strays.three_files_100_km_apart)
    assert "the files lie in 3 places far from each other:" in err
    assert "1: 1 object, 300 triangles, 168 m × 170 m around 84, 85; kept" in err
    assert "2: 1 object, 192 triangles, 128 m × 130 m around 100,064, 65; left out" in err
    assert "--cluster 2 builds the place with that number instead" in err
    assert site.names() == {"town-0"}
    err, _ = site.build("second", "--cluster", "2")
    assert "around 100,064, 65; kept" in err
    assert site.names() == {"town-1"}
    assert read_outliers(site.workspace, "town").kept == (2,)
    status, _, err = site.run("create-rendering", "town", "fourth", "--res", "1", "--cluster", "4")
    assert status == 2
    assert "cluster 4: the scene has 3 clusters" in err


def test_two_triangles_5000_km_apart_are_one_place_or_two(site: Site) -> None:
    err, _ = site.make(strays.two_triangles_5000_km_apart)
    assert "the files lie in 2 places" in err
    assert max(site.extent_m()) < 100
    _, index = site.build("whole", "--keep-outliers")
    assert site.extent_m()[0] > 4.9e6
    assert index["report"]["ground_plane_triangles"] <= 8


def test_nodata_heights_are_left_out(site: Site) -> None:
    err, _ = site.make(strays.nodata_heights)
    assert "left out 2 triangles of 1 object" in err
    assert site.extent_m()[2] < 50


def test_scattered_files_build_within_the_memory_limit(site: Site) -> None:
    """The subprocess of the build cannot allocate more than its limit."""
    err, _ = site.make(strays.scattered_files, "--max-memory", "256M")
    assert "left out" in err
    assert "huge.obj: 1 triangle" in err
    assert max(site.extent_m()) < 1000
    status, _, err = site.run("create-rendering", "town", "whole", "--res", "1000", "--keep-outliers", "--max-memory", "256M")
    assert status == 1
    assert "scene town: " in err
    assert err.count("\n") == 1
    assert "Traceback" not in err


def test_town_in_one_place_is_built_as_before(site: Site) -> None:
    err, index = site.make(lambda folder: write_citygml(folder / "town.gml", strays.UTM32, at(*MUNICH, strays.UTM32)))
    assert "far from" not in err
    assert "outlier_triangles" not in index["report"]
    assert {"keep_outliers", "cluster"}.isdisjoint(index["options"])
    assert not (site.workspace.scene_folder("town") / "outliers.json").exists()


def test_scene_without_its_outlier_has_no_list_of_outliers(site: Site) -> None:
    site.make(strays.building_of_another_zone)
    (site.folder / "files" / "other.gml").unlink()
    site.call("remove-files", "town", "other", "--yes")
    _, index = site.build("again")
    assert "outlier_triangles" not in index["report"]
    assert len(site.names()) == 16
    assert not (site.workspace.scene_folder("town") / "outliers.json").exists()
