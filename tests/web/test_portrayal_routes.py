"""The routes of the 3D Portrayal Service over ASGI."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from lxml import etree

from map3d.catalogue import Workspace
from map3d.portrayal.tracer_pool import TracerPool
from map3d.web.http.settings import ServerSettings
from map3d.web.server.asgi_app import create_app
from map3d.web.services import portrayal_routes
from tests.portrayal.queries import PERSPECTIVE, get_view
from tests.portrayal.villages import make_villages
from tests.web.conftest import Client

FAKE = "tests.portrayal.fake_tracer:open_fake"
CAPABILITIES = "/3dps?service=3DPS&request=GetCapabilities"
VIEW = f"/3dps?service=3DPS&version=1.0&{get_view(projection=PERSPECTIVE)}"
HREF = "{http://www.w3.org/1999/xlink}href"


@pytest.fixture(scope="module")
def villages(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    return make_villages(tmp_path_factory.mktemp("villages"))


@pytest.fixture
def client(villages: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Client]:
    workspace = Workspace(Path(shutil.copytree(villages.root, tmp_path / "ws")))
    monkeypatch.setattr(portrayal_routes, "make_pool", lambda: TracerPool(entry=FAKE, subprocesses=1))
    made = Client(create_app(workspace, ServerSettings()))
    yield made
    made.close()


def test_views_are_images_for_pages_of_any_origin(client: Client) -> None:
    answer = client.get(VIEW)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png")
    assert answer.headers["access-control-allow-origin"] == "*"
    assert answer.headers["x-content-type-options"] == "nosniff"
    again = client.get(VIEW, headers={"If-None-Match": answer.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    head = client.request("HEAD", VIEW)
    assert (head.status_code, head.content, head.headers["content-length"]) == (200, b"", str(len(answer.content)))


def test_capabilities_name_the_address_that_the_client_used(client: Client) -> None:
    for path, expected in ((CAPABILITIES, "http://test/3dps"), (CAPABILITIES.replace("/3dps", "/3dps/strict"), "http://test/3dps/strict")):
        root = etree.fromstring(client.get(path).content)
        assert {element.get(HREF).split("?")[0] for element in root.iter() if element.get(HREF)} == {expected}


def test_capabilities_name_the_public_address(villages: Workspace) -> None:
    made = Client(create_app(villages, ServerSettings(public_url="https://example.org/maps")))
    root = etree.fromstring(made.get(CAPABILITIES, headers={"Host": "evil"}).content)
    assert {element.get(HREF).split("?")[0] for element in root.iter() if element.get(HREF)} == {"https://example.org/maps/3dps"}
    made.close()


def test_xml_by_post(client: Client) -> None:
    body = b'<GetCapabilities xmlns="http://www.opengis.net/3dps/1.0/core" service="3DPS"/>'
    answer = client.request("POST", "/3dps", content=body, headers={"Content-Type": "text/xml"})
    assert (answer.status_code, answer.headers["content-type"]) == (200, "text/xml; charset=utf-8")
    assert client.request("POST", "/3dps", content=b"x" * 100_000).status_code == 413
    bomb = b'<!DOCTYPE a [<!ENTITY a "x">]><GetView service="3DPS" version="1.0">&a;</GetView>'
    assert client.request("POST", "/3dps", content=bomb).status_code == 400


def test_preflight_of_pages_that_post_xml(client: Client) -> None:
    answer = client.request("OPTIONS", "/3dps", headers={"Origin": "https://example.org", "Access-Control-Request-Method": "POST"})
    assert (answer.status_code, answer.headers["access-control-allow-methods"]) == (204, "GET, HEAD, POST, OPTIONS")


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH"])
def test_other_methods_are_refused(client: Client, method: str) -> None:
    assert client.request(method, "/3dps").status_code == 405


HOSTILE = {
    "a huge image": VIEW.replace("WIDTH=200", "WIDTH=99999999999999999999"),
    "a negative image": VIEW.replace("WIDTH=200", "WIDTH=-1"),
    "digits that are not ASCII": VIEW.replace("WIDTH=200", "WIDTH=%EF%BC%91"),
    "NaN": VIEW.replace(",60,", ",nan,"),
    "a long number": VIEW.replace("WIDTH=200", "WIDTH=" + "9" * 20_000),
    "a long list": VIEW.replace("layers=village", "layers=" + "," * 20_000),
    "a long system": VIEW.replace("EPSG:25832", "EPSG:25832" * 500),
    "a path as a layer": VIEW.replace("layers=village", "layers=../../etc/passwd"),
    "a PROJ string": VIEW.replace("EPSG:25832", "%2Bproj%3Dpipeline%20%2Bstep"),
    "markup": VIEW.replace("layers=village", "layers=%3Cscript%3E"),
    "bytes that are not UTF-8": VIEW.replace("layers=village", "layers=%FF%FE"),
    "zero bytes": VIEW.replace("layers=village", "layers=a%00b"),
}


@pytest.mark.parametrize("query", HOSTILE.values(), ids=HOSTILE)
def test_hostile_parameters_are_refused(client: Client, query: str) -> None:
    client.get(CAPABILITIES)
    answer = client.get(query)
    assert answer.status_code == 400
    assert "script>" not in answer.text
    etree.fromstring(answer.content)
    image = client.get(query + "&exceptions=inimage")
    assert image.headers["content-type"] in ("image/png", "text/xml; charset=utf-8")
