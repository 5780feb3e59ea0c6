"""Previews in the web interface: what they show, and what is refused before anything is rendered."""

# ruff: noqa: F811

from io import BytesIO

import pytest
from PIL import Image

from map3d.previews import preview_pool
from map3d.previews.preview_pool import PreviewPool
from tests.web.test_studio import HTML, built_town, studio, town  # noqa: F401


def preview(studio, **query):
    response = studio.client.request("GET", "/studio/scenes/town/preview.jpg", params=query, headers=studio.headers)
    return response, (Image.open(BytesIO(response.content)) if response.status_code == 200 else None)


def test_preview_shows_the_scene_from_every_direction_and_layer(town):
    pictures = {}
    for kind in ("color", "normal", "id", "depth", "ao", "sun", "depth2", "picture"):
        for look in (0, 90):
            response, picture = preview(town, kind=kind, look=look, pitch=45)
            assert response.headers["content-type"] == "image/jpeg", response.text
            assert picture.size == (512, 512)
            pictures[kind, look] = response.content
    assert len(set(pictures.values())) == len(pictures)
    whole, _ = preview(town)
    detail, picture = preview(town, res=0.05)
    assert whole.content != detail.content
    assert len(picture.convert("L").getcolors()) > 3, "the detail shows content"
    moved, _ = preview(town, res=0.05, x=0.1, y=0.5)
    assert moved.content != detail.content


HOSTILE = [
    {"pitch": "nan"}, {"pitch": "0"}, {"pitch": "-5"}, {"pitch": "91"}, {"pitch": "٤٥"}, {"look": "360"}, {"look": "inf"}, {"res": "0"},
    {"res": "1e9"}, {"kind": "sun16"}, {"kind": "data"}, {"kind": "../x"}, {"x": "2", "y": "0"}, {"x": "", "y": "nan"}, {"res": "9" * 400},
]  # fmt: skip


@pytest.mark.parametrize("query", HOSTILE, ids=str)
def test_hostile_previews_are_refused_before_anything_is_rendered(town, query, monkeypatch):
    monkeypatch.setattr(PreviewPool, "_request", lambda *_: pytest.fail("a subprocess was asked"))
    response, _ = preview(town, **query)
    assert response.status_code == 400, response.text


def test_preview_of_a_scene_that_is_not_built(studio):
    studio.post("/studio/scenes/new", title="Town", crs="local")
    response, _ = preview(studio)
    assert (response.status_code, "build it first" in response.text) == (400, True)
    assert "Build now" in studio.get("/studio/scenes/town/renderings/new").text


def test_previews_have_a_bounded_queue(town, monkeypatch):
    pool = town.client.app.site.previews
    while pool._room.acquire(blocking=False):
        pass
    response, _ = preview(town, pitch=33)
    assert response.status_code == 503
    pool._room.release()
    response, _ = preview(town, pitch=33)
    assert response.status_code == 200


def test_preview_that_takes_too_long_is_stopped(town, monkeypatch):
    preview(town)
    monkeypatch.setattr(preview_pool, "WALL_S", 0.0)
    # On a busy machine an answer may be there before the server looks at the clock.
    responses = (preview(town, pitch=pitch)[0] for pitch in range(31, 61))
    assert any((response.status_code, "stopped" in response.text) == (400, True) for response in responses)
    monkeypatch.undo()
    response, _ = preview(town, pitch=61)
    assert response.status_code == 200, "another subprocess answers the next request"
