"""Where the server's own absolute URLs come from, and that no redirect has one."""

import re

import pytest

from map3d.errors import BadRequest
from map3d.tiles import viewer_files
from map3d.web import create_app
from map3d.web.http.public_url import public_url
from map3d.web.http.settings import ServerSettings, check_public_url, settings_from_environment
from tests.web.conftest import Client, asked_of

HOSTILE = {"host": "evil.example", "x-forwarded-host": "evil.example", "forwarded": "host=evil.example"}


@pytest.mark.parametrize(
    ("path", "location"),
    [
        ("/", "view/tea/"),
        ("/view/tea", "./tea/"),
        ("/view/tea?a=1&b=%22", "./tea/?a=1&b=%22"),
        ("/view/a:b", "./a:b/"),
        ("/view/%0d%0aX", "./%0D%0AX/"),
    ],
)
def test_redirects_are_relative(client, path, location):
    response = client.get(path, headers=HOSTILE)
    assert response.status_code in (302, 308)
    assert response.headers["location"] == location


@pytest.mark.parametrize("path", ["//evil.example", "//evil.example/..", "/view//evil.example", "/\\evil.example", "/view/tea//evil.example"])
def test_no_path_redirects_to_another_host(client, path):
    location = client.get(f"http://test{path}").headers.get("location", "./")
    assert re.match(r"(\./|[a-z])", location)
    assert "//" not in location


@pytest.fixture
def configured(workspace):
    made = Client(create_app(workspace, ServerSettings(public_url="https://maps.example/city")))
    yield made
    made.close()


def test_the_public_url_is_configured(configured, tmp_path, monkeypatch):
    (tmp_path / "package" / "viewer").mkdir(parents=True)
    (tmp_path / "package" / "viewer" / "index.html").write_text("<!doctype html><head></head>")
    monkeypatch.setattr(viewer_files, "files", lambda _: tmp_path / "package")
    page = configured.get("/view/tea/", headers=HOSTILE).text
    assert '<meta property="og:url" content="https://maps.example/city/view/tea/">' in page
    assert '<meta property="og:image" content="https://maps.example/city/view/tea/preview.jpg">' in page
    assert "evil" not in page


def test_absolute_urls_begin_with_the_public_url(configured):
    with asked_of(configured.app, HOSTILE):
        assert public_url() == "https://maps.example/city"
        assert public_url("ogc/collections") == public_url("/ogc/collections") == "https://maps.example/city/ogc/collections"


def test_without_a_public_url_the_host_of_the_request_is_used(client):
    with asked_of(client.app, {"host": "localhost:8080"}):
        assert public_url() == "http://localhost:8080"
        assert public_url("ogc/") == "http://localhost:8080/ogc/"


@pytest.mark.parametrize(("given", "expected"), [("https://a.example", "https://a.example"), ("http://a.example:81/b/", "http://a.example:81/b")])
def test_the_environment_has_the_public_url(monkeypatch, given, expected):
    monkeypatch.setenv("MAP3D_PUBLIC_URL", given)
    assert settings_from_environment().public_url == expected


@pytest.mark.parametrize(
    "url", ["maps.example", "ftp://a.example", "https://", "https://u:p@a.example", "https://a.example?x=1", "https://a.example/#x", "https://a\n.b"]
)
def test_an_invalid_public_url_is_refused(url):
    with pytest.raises(BadRequest, match=re.escape("https://example.org/maps")):
        check_public_url(url)
