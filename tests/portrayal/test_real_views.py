"""Views of the real tracer: the same geometry in tiles, orthographic views, perspective, rays and positions."""

import io
import json
import math
import shutil
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from map3d.catalogue import Workspace
from map3d.portrayal.answers import Answer
from map3d.portrayal.service import PortrayalService, ServiceRequest
from map3d.portrayal.tracer_pool import TracerPool
from tests.portrayal.conftest import ENDPOINT
from tests.portrayal.queries import get_view
from tests.portrayal.villages import EAST, NORTH

Ask = Callable[[str], Answer]


@pytest.fixture(scope="module")
def service(villages: Workspace, tmp_path_factory: pytest.TempPathFactory) -> Iterator[PortrayalService]:
    workspace = Workspace(Path(shutil.copytree(villages.root, tmp_path_factory.mktemp("real") / "ws")))
    made = PortrayalService(workspace, pool=TracerPool(subprocesses=1), limit_bytes=1 << 30)
    yield made
    made.close()


@pytest.fixture
def ask(service: PortrayalService) -> Ask:
    return lambda query: service.answer(ServiceRequest(f"service=3DPS&version=1.0&{query}".encode(), None, ENDPOINT))


def pixels(answer: Answer) -> np.ndarray:
    assert answer.status == 200, answer.body
    return np.asarray(Image.open(io.BytesIO(answer.body)))


def ids(answer: Answer) -> np.ndarray:
    return np.ascontiguousarray(pixels(answer)).view("<u4")[..., 0]


def depths(answer: Answer) -> np.ndarray:
    return np.ascontiguousarray(pixels(answer)).view("<f4")[..., 0]


ID, DEPTH = {"layers": "OBJECTID", "formats": "image/png%3Bmode=32bit"}, {"layers": "DEPTH", "formats": "image/png"}


def look(name: str, poc: tuple[float, float, float], poi: tuple[float, float, float], up: str, rest: str) -> str:
    numbers = [EAST + poc[0], NORTH + poc[1], poc[2], EAST + poi[0], NORTH + poi[1], poi[2]]
    return f"{name},{','.join(f'{number:.6f}' for number in numbers)},{up},{rest}"


FROM_ABOVE = look("Orthographic", (60, 60, 500), (60, 60, 0), "0,1,0", "-100,100,-100,100,,")


def name_of(service: PortrayalService, ask: Ask, number: int) -> str:
    text = ask(f"request=GetFeatureInfoByObjectId&layers=village&format=application/json&objectId={number}").body
    return str(json.loads(text)["featureInfo"][0]["featureId"])


def test_buildings_are_where_they_are(service: PortrayalService, ask: Ask) -> None:
    """A metre per pixel from above: low-a at (0..20, 0..20), low-b at (100..120, 0..20), high-a at (0..20, 100..120)."""
    found = ids(ask(get_view(width=200, height=200, projection=FROM_ABOVE, **ID)))
    at = {name: found[160 - y - 1, x + 40] for name, x, y in (("low-a", 10, 10), ("low-b", 110, 10), ("high-a", 10, 110))}
    assert {name: name_of(service, ask, int(number)) for name, number in at.items()} == {name: name for name in at}
    for name, (x, y) in {"low-a": (0, 0), "low-b": (100, 0), "high-a": (0, 100)}.items():
        rows, columns = np.nonzero(found == at[name])
        assert (columns.min() - 40, columns.max() - 39, 160 - rows.max() - 1, 160 - rows.min()) == (x, x + 20, y, y + 20)


def test_depths_are_metres_from_the_poc(ask: Ask) -> None:
    found = depths(ask(get_view(width=200, height=200, projection=FROM_ABOVE, **DEPTH)))
    assert [round(float(found[160 - y - 1, x + 40]), 2) for x, y in ((10, 10), (110, 10), (10, 110))] == [490, 488, 470]


def test_tiles_and_tracer_show_the_same_objects(service: PortrayalService, ask: Ask) -> None:
    """An aligned view comes from tiles; with a bounding box around everything, the same pixels come from the tracer."""
    frame = service._catalogue.rendering("village").frames[0]
    origin = np.array(service._catalogue.scene("village").origin)
    pixel = frame.pixel_m(frame.zmax)
    right, up, forward = (np.array(axis) for axis in frame.axes)
    poi = right * (frame.u0_m + 700 * pixel) + up * (frame.v0_m - 600 * pixel) + origin
    numbers = ",".join(f"{value:.6f}" for value in [*(poi - forward * 2000), *poi])
    projection = f"Orthographic,{numbers},0,0,1,0,{800 * pixel},{-700 * pixel},0,,"
    everything = "&boundingbox=0,0,9000000,9000000&spatialselection=cut"
    for kind, decode in ((ID, ids), (DEPTH, depths)):
        before = service.views.computed[0]
        tiles = decode(ask(get_view(width=800, height=700, projection=projection, **kind)))
        assert service.views.computed[0] == before
        traced = decode(ask(get_view(width=800, height=700, projection=projection, more=everything, **kind)))
        assert service.views.computed[0] == before + 1
        assert np.isfinite(tiles).any()
        assert np.array_equal(tiles, traced) if decode is ids else np.allclose(tiles, traced, atol=2e-3, equal_nan=True)


STREET = look("Perspective", (60, -60, 8), (55, 60, 10), "0,0,1", "70,,,")


def test_a_ray_finds_what_the_picture_shows(ask: Ask) -> None:
    found = ids(ask(get_view(width=160, height=120, projection=STREET, **ID)))
    assert len(np.unique(found)) >= 4
    for y, x in [(60, 20), (60, 80), (70, 140), (5, 80), (110, 80), *zip(range(0, 120, 17), range(0, 160, 23), strict=False)]:
        query = f"layers=village&crs=EPSG:25832&width=160&height=120&projection={STREET}&imagePosition={x},{y}&format=application/json"
        features = json.loads(ask(f"request=GetFeatureInfoByRay&{query}").body)["featureInfo"]
        assert [feature["objectId"] for feature in features] == ([int(found[y, x])] if found[y, x] else [])


def test_perspective_is_that_of_a_pinhole(service: PortrayalService, ask: Ask) -> None:
    """A corner of a building appears where the pinhole's formula puts it."""
    found = ids(ask(get_view(width=400, height=300, projection=look("Perspective", (10, -90, 5), (10, 0, 5), "0,0,1", "60,,,"), **ID)))
    wall = next(number for number in np.unique(found) if number and name_of(service, ask, int(number)) == "low-a")
    rows, columns = np.nonzero(found == wall)
    focal = 200 / math.tan(math.radians(30))
    half = 10 / 90 * focal
    assert abs(columns.min() - (200 - half)) <= 1
    assert abs(columns.max() + 1 - (200 + half)) <= 1
    assert abs(rows.min() - (150 - 5 / 90 * focal)) <= 1


def test_depth_of_a_wall_is_its_distance_along_the_view(ask: Ask) -> None:
    found = depths(ask(get_view(width=400, height=300, projection=look("Perspective", (10, -90, 5), (10, 0, 5), "0,0,1", "60,,,"), **DEPTH)))
    assert np.allclose(found[140:160, 185:215], 90, atol=2e-3), "one distance over the whole wall, not along each ray"


def test_information_by_position_finds_the_nearest_surface(ask: Ask) -> None:
    def names(x: float, y: float, z: float, tolerance: float) -> list[str]:
        query = f"coordinate={EAST + x},{NORTH + y},{z}&tolerance={tolerance}&featureCount=9&format=application/json"
        answer = ask(f"request=GetFeatureInfoByPosition&layers=village/low,village/high&crs=EPSG:25832&{query}")
        return [feature["featureId"] for feature in json.loads(answer.body)["featureInfo"]]

    assert names(10, 10, 10, 0.5) == ["low-a"]
    assert names(-3, 10, 5, 2) == []
    assert names(-3, 10, 5, 4) == ["low-a"]


def test_cut_shows_only_what_is_inside_the_box(ask: Ask) -> None:
    box = f"&boundingbox={EAST + 10},{NORTH - 50},{EAST + 200},{NORTH + 200}&spatialselection=cut"
    found = ids(ask(get_view(width=200, height=200, projection=FROM_ABOVE, more=box, scene="village/low", **ID)))
    columns = np.nonzero(found)[1]
    assert (columns.min() - 40, columns.max() - 39) == (10, 120)


def test_asset_layers_show_only_their_objects(ask: Ask) -> None:
    found = {
        scene: set(np.unique(ids(ask(get_view(width=200, height=200, projection=FROM_ABOVE, scene=scene, **ID)))).tolist()) - {0}
        for scene in ("village/low", "village/high", "village/low,village/high")
    }
    assert (len(found["village/low"]), len(found["village/high"])) == (2, 1)
    assert found["village/low"] | found["village/high"] <= found["village/low,village/high"]


def test_a_northing_first_system_shows_the_same_world(ask: Ask) -> None:
    view = "Perspective,{},{},40,{},{},4,0,0,1,40,,,"
    own = view.format(5399980.0, 3500014.0, 5400025.0, 3500014.0)
    found = ids(ask(get_view(width=100, height=80, projection=own, scene="harbour", crs="EPSG:31467", **ID)))
    assert found[40, 50] != 0
    assert (
        struct.unpack("<I", bytes(pixels(ask(get_view(width=100, height=80, projection=own, scene="harbour", crs="EPSG:31467", **ID)))[40, 50]))[0]
        == found[40, 50]
    )


def test_a_view_over_the_time_limit_ends(workspace: Workspace) -> None:
    service = PortrayalService(workspace, pool=TracerPool(subprocesses=1, deadline_s=0.001), limit_bytes=0)
    answer = service.answer(
        ServiceRequest(f"service=3DPS&version=1.0&{get_view(width=2048, height=2048, projection=STREET)}".encode(), None, ENDPOINT)
    )
    assert answer.status == 504
    service.close()
