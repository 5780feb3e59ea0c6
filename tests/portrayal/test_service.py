"""The service on built scenes, with a tracer of predictable pictures."""

import io
import json
import threading
from concurrent.futures import wait
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from PIL import Image

from map3d.catalogue import Workspace
from map3d.portrayal.answers import BOUNDARY, Answer
from map3d.portrayal.service import PortrayalService, ServiceRequest
from map3d.portrayal.tracer_pool import TracerPool
from map3d.tiles.decode_tile import as_layer, find_layer
from map3d.tiles.track_stores import open_track
from tests.portrayal.conftest import ENDPOINT, FAKE, Ask
from tests.portrayal.fake_tracer import CRASH_PX, SLOW_PX, STUCK_PX
from tests.portrayal.queries import ORTHOGRAPHIC, PERSPECTIVE, get_view
from tests.portrayal.villages import EAST, NORTH

OWS = "{http://www.opengis.net/ows/2.0}"
INFO = "{http://www.opengis.net/3dps/1.0/info}"


def code(answer: Answer) -> tuple[str, str | None]:
    found = etree.fromstring(answer.body).find(f"{OWS}Exception")
    return found.get("exceptionCode"), found.get("locator")


def image(answer: Answer) -> Image.Image:
    picture = Image.open(io.BytesIO(answer.body))
    picture.load()
    return picture


def parts(answer: Answer) -> list[tuple[str, bytes]]:
    """Splits a multipart message as RFC 2046 says."""
    assert answer.media_type == f'multipart/mixed; boundary="{BOUNDARY}"'
    pieces = answer.body.split(f"--{BOUNDARY}".encode())
    assert (pieces[0], pieces[-1]) == (b"", b"--\r\n")
    found = []
    for piece in pieces[1:-1]:
        head, body = piece.removeprefix(b"\r\n").removesuffix(b"\r\n").split(b"\r\n\r\n", 1)
        found.append((head.decode().split("Content-Type: ")[1].split("\r\n")[0], body))
    return found


def test_one_image_layer_is_an_image_of_the_requested_size(ask: Ask) -> None:
    answer = ask(get_view(width=200, height=150, projection=PERSPECTIVE))
    assert (answer.status, answer.media_type, image(answer).size) == (200, "image/png", (200, 150))


def test_several_portrayals_and_layers_are_parts_in_order(ask: Ask) -> None:
    one = f"WIDTH=64;HEIGHT=48;PROJECTION={PERSPECTIVE};IMAGELAYERS=COLOR,OBJECTID;FORMATS=image/jpeg,image/png%3Bmode=32bit"
    two = f"WIDTH=32;HEIGHT=16;PROJECTION={ORTHOGRAPHIC};IMAGELAYERS=MASK;FORMATS=image/png"
    found = parts(ask(get_view(portrayals=f"{one}@{two}")))
    assert [kind for kind, _ in found] == ["image/jpeg", "image/png;mode=32bit", "image/png"]
    assert [Image.open(io.BytesIO(data)).size for _, data in found] == [(64, 48), (64, 48), (32, 16)]


def test_one_failed_part_fails_the_whole_request(ask: Ask) -> None:
    good = f"WIDTH=64;HEIGHT=48;PROJECTION={PERSPECTIVE};IMAGELAYERS=COLOR;FORMATS=image/png"
    answer = ask(get_view(portrayals=f"{good}@{good.replace('WIDTH=64', f'WIDTH={CRASH_PX}')}"))
    assert (answer.status, answer.media_type) == (500, "text/xml")


ALIASES = {
    "order": "layers=village&crs=EPSG:25832&request=GetView&portrayals={p}",
    "case": "REQUEST=GetView&CRS=epsg:25832&Layers=village&PORTRAYALS={p}",
    "another spelling of the system": "request=GetView&crs=urn:ogc:def:crs:EPSG::25832&layers=village&portrayals={p}",
    "defaults written out": "request=GetView&crs=EPSG:25832&layers=village&styles=textured&backgroundcolor=0xffffff&exceptions=blank&portrayals={p}",
    "all assets instead of the scene": "request=GetView&crs=EPSG:25832&layers=village/high,village/low&portrayals={p}",
    "the vertical datum": "request=GetView&crs=EPSG:25832%2B7837&layers=village&portrayals={p}",
}


@pytest.mark.parametrize("alias", ALIASES.values(), ids=ALIASES)
def test_aliases_of_one_view_are_computed_once(ask: Ask, service: PortrayalService, alias: str) -> None:
    portrayals = f"WIDTH=200;HEIGHT=150;PROJECTION={PERSPECTIVE};IMAGELAYERS=COLOR;FORMATS=image/png"
    first = ask(get_view(projection=PERSPECTIVE))
    second = ask(alias.format(p=portrayals.replace("60,,,", "60.0,,,100000")))
    assert (second.status, second.body, second.headers) == (200, first.body, first.headers)
    assert service.views.computed == [1]


def test_stored_views_survive_a_restart(workspace: Workspace) -> None:
    request = ServiceRequest(f"service=3DPS&version=1.0&{get_view(projection=PERSPECTIVE)}".encode(), None, ENDPOINT)
    bodies = []
    for traced in ([1], [0]):
        service = PortrayalService(workspace, pool=TracerPool(entry=FAKE, subprocesses=1), limit_bytes=1 << 30)
        bodies.append(service.answer(request).body)
        assert service.views.computed == traced
        service.close()
    assert bodies[0] == bodies[1]


def test_identical_requests_at_the_same_time_are_computed_once(service: PortrayalService) -> None:
    query = f"service=3DPS&version=1.0&{get_view(width=SLOW_PX, projection=PERSPECTIVE)}".encode()
    futures = [service.submit(ServiceRequest(query, None, ENDPOINT)) for _ in range(500)]
    wait(futures)
    assert {(future.result().status, future.result().body) for future in futures} == {(200, futures[0].result().body)}
    assert service.views.computed == [1]


def test_a_changed_scene_is_not_answered_from_old_pictures(ask: Ask, service: PortrayalService, workspace: Workspace) -> None:
    before = ask(get_view(projection=PERSPECTIVE))
    path = workspace.scene_folder("village") / "scene.json"
    path.write_text(path.read_text() + " ")
    after = ask(get_view(projection=PERSPECTIVE))
    assert service.views.computed == [2]
    assert before.headers["ETag"] != after.headers["ETag"]


def test_errors_are_not_stored(ask: Ask, service: PortrayalService) -> None:
    for _ in range(2):
        answer = ask(get_view(width=CRASH_PX, projection=PERSPECTIVE))
        assert (answer.status, code(answer), answer.headers["Cache-Control"]) == (500, ("NoApplicableCode", None), "no-store")
    assert service.views.computed == [2]
    assert service._store.used_bytes() == 0
    assert ask(get_view(projection=PERSPECTIVE)).status == 200, "a new subprocess takes over"


def test_a_view_that_does_not_end_is_ended(workspace: Workspace) -> None:
    service = PortrayalService(workspace, pool=TracerPool(entry=FAKE, subprocesses=1, deadline_s=0.1), limit_bytes=1 << 30)
    answer = service.answer(ServiceRequest(f"service=3DPS&version=1.0&{get_view(width=STUCK_PX, projection=PERSPECTIVE)}".encode(), None, ENDPOINT))
    assert (answer.status, code(answer)) == (504, ("NoApplicableCode", None))
    service.close()


def test_a_full_queue_is_refused_with_retry_after(workspace: Workspace) -> None:
    pool = TracerPool(entry=FAKE, subprocesses=1, queue=1, deadline_s=30)
    service = PortrayalService(workspace, pool=pool, limit_bytes=1 << 30)
    queries = [f"service=3DPS&version=1.0&{get_view(width=SLOW_PX, height=100 + k, projection=PERSPECTIVE)}" for k in range(20)]
    answers = [future.result() for future in [service.submit(ServiceRequest(query.encode(), None, ENDPOINT)) for query in queries]]
    refused = [answer for answer in answers if answer.status == 503]
    assert refused
    assert all(answer.headers["Retry-After"] == "5" for answer in refused)
    assert {answer.status for answer in answers} == {200, 503}
    service.close()


# -- from the tiles of a pyramid -----------------------------------------------------------------------------------------------------


def aligned(
    service: PortrayalService, left: int, top: int, width: int, height: int, z: int | None = None, more: str = "", shift: float = 0.0, **options: str
) -> str:
    """Returns a view of pixels of the village's pyramid."""
    frame = service._catalogue.rendering("village").frames[0]
    origin = np.array(service._catalogue.scene("village").origin)
    pixel = frame.pixel_m(frame.zmax if z is None else z)
    right, up, forward = (np.array(axis) for axis in frame.axes)
    poi = right * (frame.u0_m + left * pixel + shift) + up * (frame.v0_m - top * pixel) + origin
    poc = poi - forward * 2000
    numbers = ",".join(f"{value:.6f}" for value in [*poc, *poi])
    borders = f"{-shift:.9f},{width * pixel - shift:.9f},{-height * pixel:.9f},0"
    return get_view(width=width, height=height, projection=f"Orthographic,{numbers},0,0,1,{borders},,", more=more, **options)


def stored_pixels(service: PortrayalService, layer: str, left: int, top: int, width: int, height: int) -> np.ndarray:
    """Returns the pixels of a layer of the pyramid's deepest level, tile by tile."""
    record = service._catalogue.rendering("village")
    frame = record.frames[0]
    whole = np.zeros((frame.tile_px << frame.zmax, frame.tile_px << frame.zmax, 4), np.uint8)
    with open_track(service.views.workspace, record, frame.id) as store:
        found = find_layer(record.layers, layer)
        assert found is not None
        asked, stored = found
        number = store.shape.layer_number(stored.name)
        for tile in store.list_tiles(number):
            if tile.z == frame.zmax:
                x, y = tile.x * frame.tile_px, tile.y * frame.tile_px
                data = as_layer(asked, stored, store.get_tile(number, *tile), frame.tile_px, str(tile))
                whole[y : y + frame.tile_px, x : x + frame.tile_px] = np.asarray(Image.open(io.BytesIO(data)))
    return whole[top : top + height, left : left + width]


@pytest.mark.parametrize("rectangle", [(768, 768, 256, 256), (700, 800, 513, 311), (-50, -60, 900, 900)])
def test_aligned_views_have_the_ids_of_the_tiles(ask: Ask, service: PortrayalService, rectangle: tuple[int, int, int, int]) -> None:
    answer = ask(aligned(service, *rectangle, layers="OBJECTID", formats="image/png%3Bmode=32bit"))
    found = np.asarray(image(answer)).view("<u4")[..., 0]
    left, top, width, height = rectangle
    expected = np.zeros((height, width), np.uint32)
    x, y = max(-left, 0), max(-top, 0)
    expected[y:, x:] = np.ascontiguousarray(stored_pixels(service, "id", max(left, 0), max(top, 0), width - x, height - y)).view("<u4")[..., 0]
    pages = service.views.state.pages("village", 1)
    expected = np.where(expected == 0, 0, expected + (pages[0] << 16))
    assert service.views.computed == [0]
    assert expected.any()
    assert np.array_equal(found, expected)


def test_depths_of_aligned_views_begin_at_the_poc(ask: Ask, service: PortrayalService) -> None:
    answer = ask(aligned(service, 700, 700, 600, 600, layers="DEPTH", formats="image/png"))
    found = np.asarray(image(answer)).view("<f4")[..., 0]
    units = np.ascontiguousarray(stored_pixels(service, "depth", 700, 700, 600, 600)).view("<u4")[..., 0]
    frame = service._catalogue.rendering("village").frames[0]
    covered = np.isfinite(found)
    assert covered.any()
    assert service.views.computed == [0]
    assert np.ptp((units[covered] / 1024 + frame.d0_m) - found[covered]) < 0.01, "one distance between both zeros"


def test_a_shifted_poc_is_the_same_aligned_view(ask: Ask, service: PortrayalService) -> None:
    first, second = (ask(aligned(service, 700, 700, 300, 200, shift=shift)) for shift in (0.0, 12.25))
    assert first.headers == second.headers


@pytest.mark.parametrize(
    "change",
    [
        {"more": "&boundingbox=0,0,9000000,9000000"},
        {"scene": "village/low"},
        {"more": "&lods=CityGML:2"},
        {"layers": "AO"},
    ],
)
def test_other_content_is_traced(ask: Ask, service: PortrayalService, change: dict[str, str]) -> None:
    assert ask(aligned(service, 700, 700, 300, 200, **change)).status == 200
    assert service.views.computed == [1]


def test_pixels_between_those_of_the_grid_are_traced(ask: Ask, service: PortrayalService) -> None:
    assert ask(aligned(service, 700, 700, 300, 200, shift=0.1).replace("-0.100000000", "-0.060000000", 1)).status == 200
    assert service.views.computed == [1]


def test_tiles_of_an_older_scene_are_not_used(ask: Ask, service: PortrayalService, workspace: Workspace) -> None:
    path = workspace.scene_folder("village") / "scene.json"
    path.write_text(path.read_text() + " ")
    assert ask(aligned(service, 700, 700, 300, 200)).status == 200
    assert service.views.computed == [1]


# -- layers, levels of detail, boxes ----------------------------------------------------------------------------------------------------


def shown(ask: Ask, more: str = "", scene: str = "village") -> bool:
    """Whether the fake's object 2, `low-b`, is in a view."""
    answer = ask(get_view(projection=PERSPECTIVE, layers="MASK", more=more, scene=scene))
    assert answer.status == 200, answer.body
    return not bool(np.asarray(image(answer)).all())


@pytest.mark.parametrize(
    ("more", "scene", "expected"),
    [
        ("", "village", True),
        ("", "village/low", True),
        ("", "village/high", False),
        ("&lods=CityGML:1", "village/low", True),
        ("&lods=CityGML:2", "village", False),
        ("&lods=CityGML:2&lodselection=equals_or_smaller", "village", True),
        ("&lods=CityGML:2&lodselection=combined", "village", True),
        ("&lods=CityGML:2&lodselection=equals_or_similar", "village", True),
        ("&lods=,CityGML:2", "village/low,village/high", True),
        (f"&boundingbox={EAST + 115},{NORTH},{EAST + 200},{NORTH + 50}", "village", True),
        (f"&boundingbox={EAST + 125},{NORTH},{EAST + 200},{NORTH + 50}", "village", False),
        (f"&boundingbox={EAST + 115},{NORTH},{EAST + 200},{NORTH + 50}&spatialselection=contains_center", "village", False),
        (f"&boundingbox={EAST + 105},{NORTH},{EAST + 200},{NORTH + 50}&spatialselection=contains_center", "village", True),
        (f"&boundingbox={EAST + 105},{NORTH},13,{EAST + 200},{NORTH + 50},90", "village", False),
        (f"&boundingbox={EAST + 105},{NORTH},11,{EAST + 200},{NORTH + 50},90,EPSG:25832", "village", True),
    ],
)
def test_selection(ask: Ask, more: str, scene: str, expected: bool) -> None:
    assert shown(ask, more, scene) == expected


@pytest.mark.parametrize(
    ("more", "scene", "expected"),
    [
        ("&styles=glass", "village", ("StyleNotDefined", "glass")),
        ("&overallstyles=fog", "village", ("StyleNotDefined", "fog")),
        ("&background=stars", "village", ("BackgroundNotDefined", "stars")),
        ("&deliveryoptions=fast", "village", ("DeliveryOptionNotDefined", "fast")),
        ("&lods=CityGML:4", "village", ("LODNotDefined", "CityGML:4")),
        ("&lods=INSPIRE:2", "village", ("LODNotDefined", "INSPIRE:2")),
        ("&lods=CityGML:2", "harbour", ("LODNotApplicable", "CityGML:2")),
        ("", "nowhere", ("InvalidParameterValue", "layers")),
        ("", "village/nothing", ("InvalidParameterValue", "layers")),
        ("&exceptions=text/rtf", "village", ("ExceptionNotSupported", "text/rtf")),
    ],
)
def test_names_that_are_not_advertised(ask: Ask, more: str, scene: str, expected: tuple[str, str]) -> None:
    crs = "EPSG:31467" if scene == "harbour" else "EPSG:25832"
    answer = ask(get_view(projection=PERSPECTIVE, more=more, scene=scene, crs=crs))
    assert (answer.status, code(answer)) == (400, expected)


def test_layers_may_be_empty(ask: Ask) -> None:
    assert ask(get_view(projection=PERSPECTIVE, scene="", crs="EPSG:4326")).status == 400, "metres are no degrees"
    assert ask(get_view(projection="Perspective,48.1,11.5,900,48.2,11.5,0,0,0,1,60,,,", scene="", crs="EPSG:4326")).status == 200


def test_backgrounds(ask: Ask) -> None:
    corner = {}
    for more in ("", "&backgroundcolor=0x102030", "&background=black&backgroundcolor=0x102030", "&transparentbackground=true"):
        corner[more] = image(ask(get_view(projection=PERSPECTIVE, more=more))).getpixel((199, 0))
    assert list(corner.values()) == [(255, 255, 255), (16, 32, 48), (0, 0, 0), (0, 0, 0, 0)]


# -- exceptions -------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["inimage", "INIMAGE", "application/vnd.ogc.se_inimage", "blank"])
def test_errors_as_images(ask: Ask, form: str) -> None:
    answer = ask(get_view(width=320, height=200, scene="nowhere", formats="image/jpeg", more=f"&exceptions={form}&backgroundcolor=0x00FF00"))
    picture = image(answer)
    assert (answer.media_type, picture.size, answer.headers["Cache-Control"]) == ("image/jpeg", (320, 200), "no-store")
    colors = np.unique(np.asarray(picture).reshape(-1, 3) // 64, axis=0)
    assert (len(colors) > 1) == (form != "blank")


def test_errors_of_several_images_are_as_many_images(ask: Ask) -> None:
    answer = ask(get_view(scene="nowhere", layers="COLOR,DEPTH", formats="image/png,image/png%3Bmode=32bit", more="&exceptions=blank"))
    assert [kind for kind, _ in parts(answer)] == ["image/png", "image/png;mode=32bit"]


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("", ("MissingParameterValue", "request")),
        ("request=GetView", ("MissingParameterValue", "service")),
        ("service=WMS&request=GetView", ("InvalidParameterValue", "service")),
        ("service=3DPS&request=GetView", ("MissingParameterValue", "version")),
        ("service=3DPS&request=GetView&version=2.0", ("InvalidParameterValue", "version")),
        ("service=3DPS&request=GetScene&version=1.0", ("OperationNotSupported", "GetScene")),
        ("service=3DPS&service=3DPS", ("InvalidParameterValue", "service")),
        ("service=3DPS&request=GetCapabilities&acceptVersions=0.3,2.0", ("VersionNegotiationFailed", "acceptVersions")),
        ("service=3DPS&request=GetCapabilities&updateSequence=999", ("InvalidUpdateSequence", "updateSequence")),
        ("service=3DPS&request=GetCapabilities&sections=Everything", ("InvalidParameterValue", "sections")),
    ],
)
def test_requests_that_are_not_understood(ask: Ask, query: str, expected: tuple[str, str]) -> None:
    answer = ask(query, raw=True)
    assert answer.status == (501 if expected[0] == "OperationNotSupported" else 400)
    assert code(answer) == expected


# -- information ------------------------------------------------------------------------------------------------------------------------


def features(answer: Answer) -> list[str]:
    assert answer.status == 200, answer.body
    return [found.findtext(f"{INFO}FeatureId") for found in etree.fromstring(answer.body)]


def test_information_by_object_id(ask: Ask, service: PortrayalService) -> None:
    ask("request=GetCapabilities")
    first = service.views.state.pages("village", 1)[0] << 16
    by_id = "request=GetFeatureInfoByObjectId&layers=village&format={}&objectId={}"
    names = features(ask(by_id.format("text/xml", f"{first + 1},{first + 2},{first + 3}")))
    assert sorted(names) == ["high-a", "low-a", "low-b"]
    answer = etree.fromstring(ask(by_id.format("text/xml", first + 2)).body)
    owner = answer.xpath("//*[@name='owner']")[0]
    assert owner.text == "<b>Å</b>"
    entries = json.loads(ask(by_id.format("application/json", f"{first + 2},{first + 1}")).body)["featureInfo"]
    assert [entry["objectId"] - first for entry in entries] == [2, 1]
    page = ask(by_id.format("text/html", first + 2)).body.decode()
    assert "&lt;b&gt;Å&lt;/b&gt;" in page
    assert "<b>Å" not in page
    brief = etree.fromstring(ask(by_id.format("text/xml", first + 2) + "&idOnly=true").body)
    assert brief.xpath("count(//*[local-name()='FeatureAttribute'])") == 0


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("layers=village&format=text/plain&objectId=1", ("FormatNotSupported", "text/plain")),
        ("layers=sea&format=text/xml&objectId=1", ("UnknownLayer", "sea")),
        ("layers=village&format=text/xml", ("MissingParameterValue", "objectId")),
        ("layers=village&format=text/xml&objectId=١", ("InvalidParameterValue", "objectId")),
        ("layers=village&format=text/xml&objectId=4294967296", ("InvalidParameterValue", "objectId")),
        ("layers=village&format=text/xml&objectId=60000", ("InvalidParameterValue", "objectId")),
        ("layers=village&format=text/xml&objectId=1,2&featureCount=3", ("InvalidParameterValue", "featureCount")),
        ("layers=village&format=text/xml&objectId=1&exceptions=inimage", ("ExceptionNotSupported", "inimage")),
        ("format=text/xml&objectId=1", ("MissingParameterValue", "layers")),
    ],
)
def test_information_is_refused(ask: Ask, query: str, expected: tuple[str, str]) -> None:
    answer = ask(f"request=GetFeatureInfoByObjectId&{query}")
    assert (answer.status, code(answer)) == (400, expected)


def by_ray(x: int, more: str = "", layers: str = "village") -> str:
    pixel = f"width=200&height=100&projection={PERSPECTIVE}&imagePosition={x},50"
    return f"request=GetFeatureInfoByRay&layers={layers}&format=text/xml&crs=EPSG:25832&{pixel}{more}"


def test_information_by_ray(ask: Ask) -> None:
    assert features(ask(by_ray(10))) == ["low-b"]
    assert features(ask(by_ray(10, "&featureCount=5"))) == ["low-b", "low-a"]
    assert features(ask(by_ray(150))) == []
    assert features(ask(by_ray(10, layers="village/high"))) == []
    assert code(ask(by_ray(200))) == ("InvalidParameterValue", "imagePosition")
    assert code(ask(by_ray(10).replace("25832", "2056"))) == ("CRSNotSupported", "EPSG:2056")


def test_information_by_position(ask: Ask) -> None:
    query = f"request=GetFeatureInfoByPosition&layers=village&format=text/xml&crs=EPSG:25832&coordinate={EAST},{NORTH},5&tolerance={{}}"
    assert features(ask(query.format(100))) == ["low-b"], "the fake's surface is 50 m away"
    assert features(ask(query.format(10))) == []
    assert code(ask(query.format(-1))) == ("InvalidParameterValue", "tolerance")
    assert code(ask(query.format(1).replace(",5&", "&"))) == ("InvalidParameterValue", "coordinate")


# -- resources --------------------------------------------------------------------------------------------------------------------------


def test_resources_are_the_stored_bytes(ask: Ask, workspace: Workspace) -> None:
    by_id = "request=GetResourceById&resourceId={}&outputFormat={}"
    manifest = ask(by_id.format("tiles/village/rendering.json", "application/json"))
    assert manifest.body == workspace.manifest_path("village").read_bytes()
    assert ask(by_id.format("tiles/village/0-45/color/0/0/0", "image/webp")).body[8:12] == b"WEBP"
    for bad in (
        "tiles/village/0-45/color/9/0/0",
        "tiles/village/0-45/color/00/0/0",
        "tiles/nothing/rendering.json",
        "tiles/../rendering.json",
        "etc",
    ):
        answer = ask(by_id.format(bad, "image/webp"))
        assert (answer.status, code(answer)) == (404, ("InvalidParameterValue", "resourceId"))
    assert code(ask(by_id.format("tiles/village/rendering.json", "image/png"))) == ("InvalidParameterValue", "outputFormat")


def test_threads_share_the_service(service: PortrayalService) -> None:
    statuses: list[int] = []

    def work(number: int) -> None:
        query = get_view(width=100 + number % 5, projection=PERSPECTIVE)
        statuses.append(service.answer(ServiceRequest(f"service=3DPS&version=1.0&{query}".encode(), None, ENDPOINT)).status)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert statuses == [200] * 20
    assert service.views.computed == [5]


def test_scenes_that_are_not_built_have_no_layer(service: PortrayalService, ask: Ask, workspace: Workspace, tmp_path: Path) -> None:
    (workspace.scene_folder("harbour") / "scene.json").rename(tmp_path / "scene.json")
    text = ask("request=GetCapabilities").body.decode()
    assert "<ows:Identifier>village</ows:Identifier>" in text
    assert "harbour" not in text


@pytest.mark.parametrize("strict", [False, True])
def test_capabilities_link_the_manifests_of_a_layers_renderings(ask: Ask, strict: bool) -> None:
    root = etree.fromstring(ask("service=3DPS&request=GetCapabilities", raw=True, strict=strict).body)
    links = {
        layer.xpath("string(*[local-name()='Identifier'])"): layer.xpath("*[local-name()='Metadata']/@*[local-name()='href']")
        for layer in root.xpath("//*[local-name()='Layer']")
    }
    counts = {name: len(found) for name, found in links.items()}
    assert counts == {"village": 1, "village/high": 0, "village/low": 0, "harbour": 1, "harbour/boxes": 0}
    assert root.xpath("//*[local-name()='Metadata']/@*[local-name()='role']") == ["urn:map3d:def:rendering"] * 2
    for name in ("village", "harbour"):
        address, _, query = links[name][0].partition("?")
        answer = ask(query, raw=True)
        assert (address, answer.media_type, json.loads(answer.body)["name"]) == ("http://example.org/3dps", "application/json", name)


def test_a_removed_rendering_changes_the_capabilities_and_their_sequence(ask: Ask, workspace: Workspace) -> None:
    def sequence() -> tuple[int, int]:
        root = etree.fromstring(ask("service=3DPS&request=GetCapabilities", raw=True).body)
        return int(root.get("updateSequence")), len(root.xpath("//*[local-name()='Metadata']"))

    first = sequence()
    assert first == sequence() == (1, 2)
    workspace.manifest_path("harbour").unlink()
    assert sequence() == (2, 1)
