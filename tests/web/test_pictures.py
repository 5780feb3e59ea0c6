"""Pictures to share, links with a view, and QR codes, over HTTP."""

import html
import re
from io import BytesIO
from urllib.parse import quote
from xml.etree import ElementTree

import pytest
import segno
from PIL import Image

from map3d.tiles import viewer_files
from map3d.web.http.headers import CONTENT_SECURITY_POLICY
from map3d.web.tiles import picture_routes
from tests.web.workspaces import make_workspace

VIEW = "0-45/691010.5/5336020.2/505.0/3.25"
WHERE = "691010.5,5336020.2,3.25,0,45,505"


@pytest.fixture
def page(tmp_path, monkeypatch):
    """Replaces the viewer's files, which may not be built."""
    folder = tmp_path / "package" / "viewer"
    folder.mkdir(parents=True)
    (folder / "index.html").write_text('<!doctype html><head><title>map3d</title>\n<script type="module" src="page.js"></script>\n</head>')
    monkeypatch.setattr(viewer_files, "files", lambda _: folder.parent)


@pytest.mark.parametrize("prefix", ["/tea/static", "/pictures/tea"])
def test_a_picture_has_the_size_and_format_that_its_address_names(client, prefix):
    for name, expected in (("300x200.png", "PNG"), ("300x200.jpg", "JPEG"), ("150x100@2x.webp", "WEBP")):
        response = client.get(f"{prefix}/{WHERE}/{name}?style=color")
        assert response.status_code == 200, response.text
        with Image.open(BytesIO(response.content)) as picture:
            assert (picture.size, picture.format) == ((300, 200), expected)
        assert response.headers["content-type"] == f"image/{expected.lower()}"


def test_spellings_of_one_picture_share_address_and_validator(client):
    first = client.get(f"/tea/static/{WHERE}/300x200.png?style=color")
    other = client.get("/pictures/tea/691010.50,5336020.2001,3.25,0,45.0,505.0/300x200.png?style=color")
    assert first.headers["etag"] == other.headers["etag"]
    assert first.headers["content-location"] == other.headers["content-location"] == f"http://test/pictures/tea/{WHERE}/300x200.png?style=color"
    again = client.get(f"/tea/static/{WHERE}/300x200.png?style=color", headers={"if-none-match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert client.get(f"/tea/static/{WHERE}/301x200.png?style=color").headers["etag"] != first.headers["etag"]


@pytest.mark.parametrize(
    ("path", "status"),
    [
        (f"/tea/static/{WHERE}/5000x1.png", 413),
        ("/tea/static/nan,0,3,0/300x200.png", 400),
        ("/tea/static/1,2,3,7/300x200.png", 404),
        (f"/tea/static/{WHERE}/300x200.png?style=depth", 404),
        (f"/tea/static/{WHERE}/300x200.exe", 400),
        (f"/nothing/static/{WHERE}/300x200.png", 404),
        (f"/Tea/static/{WHERE}/300x200.png", 404),
        ("/view/tea/qr.svg", 400),
        ("/view/tea/qr.svg?view=" + "0" * 4000, 400),
        ("/view/nothing/qr.svg?view=" + VIEW, 404),
    ],
)
def test_other_addresses_are_refused(client, path, status):
    response = client.get(path)
    assert (response.status_code, response.headers["cache-control"]) == (status, "no-store")


@pytest.mark.parametrize("name", ["view", "static", "tiles", "pictures", "ogc"])
def test_a_rendering_may_have_the_name_of_another_address(tmp_path, name):
    from map3d.web.server.asgi_app import create_app
    from tests.web.conftest import Client

    client = Client(create_app(make_workspace(tmp_path / "ws", name)))
    try:
        response = client.get(f"/pictures/{name}/{WHERE}/30x20.png?style=color")
        assert response.status_code == 200
        assert client.get(f"/tiles/{name}/rendering.json").status_code == 200
    finally:
        client.close()


def head_of(response):
    return dict(re.findall(r'<meta property="([^"]*)" content="([^"]*)"', response.text))


def test_a_link_with_a_view_has_a_picture_of_that_view(client, page):
    response = client.get(f"/view/tea/?view={VIEW}/t=2026-06-21T12:00Z")
    head = {key: html.unescape(value) for key, value in head_of(response).items()}
    assert head["og:image"] == f"http://test/pictures/tea/{WHERE}/1200x630.jpg?style=lit"
    assert head["og:url"] == f"http://test/view/tea/?view={VIEW}/t=2026-06-21T12:00Z"
    assert (head["og:image:width"], head["og:image:height"]) == ("1200", "630")
    assert client.get(head["og:image"].replace("lit", "color").removeprefix("http://test")).status_code == 200


@pytest.mark.parametrize("link", ["", "9-9/1/2/3/4", "<script>", "0-45/nan/2/3/4", "x" * 5000])
def test_a_broken_link_has_the_picture_of_the_whole_rendering(client, page, link):
    response = client.get("/view/tea/", params={"view": link})
    assert response.status_code == 200
    assert head_of(response)["og:image"] == "http://test/view/tea/preview.jpg"
    assert "<script>" not in response.text


def test_the_served_page_has_the_share_dialog_before_the_viewer(client, page):
    text = client.get("/view/tea/").text
    sources = re.findall(r'<script[^>]* src="([^"]*)"', text)
    assert sources == ["../../static/share/open_link.js", "../../static/share/share.js", "page.js"]
    for source in (*sources[:2], re.search(r'rel="stylesheet" href="([^"]*)"', text)[1]):
        assert client.get(source.replace("../..", "")).status_code == 200
    assert "'unsafe-inline'" not in CONTENT_SECURITY_POLICY
    assert not re.search(r"<script(?![^>]* src=)", text)


def test_a_qr_code_holds_the_link(client):
    response = client.get(f"/view/tea/qr.svg?view={quote(VIEW)}")
    assert response.headers["content-type"].startswith("image/svg+xml")
    assert ElementTree.fromstring(response.content).tag == "{http://www.w3.org/2000/svg}svg"
    expected = BytesIO()
    segno.make(f"http://test/view/tea/?view={VIEW}", error="m", micro=False).save(
        expected, kind="svg", scale=8, border=4, dark="#000", light="#fff", title="tea"
    )
    assert response.content == expected.getvalue()


def test_a_full_queue_of_pictures_is_refused_at_once(client):
    for _ in range(picture_routes.QUEUE):
        assert picture_routes._queue.acquire(blocking=False)
    try:
        response = client.get(f"/tea/static/{WHERE}/31x21.png?style=color")
        assert (response.status_code, response.headers["retry-after"]) == (503, "5")
    finally:
        for _ in range(picture_routes.QUEUE):
            picture_routes._queue.release()
    assert client.get(f"/tea/static/{WHERE}/31x21.png?style=color").status_code == 200
