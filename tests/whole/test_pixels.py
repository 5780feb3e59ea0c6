"""Ids and depths reach the browser bit for bit; a highlight changes the pixels of its object and no others."""

import base64
import hashlib
from pathlib import Path

import numpy as np
import pytest

from tests.whole.browsing import browse, picture
from tests.whole.core_pixels import CoreView

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 701, 501
"""Odd, so that a pixel's centre can lie in the middle."""
EMPTY = {"id": 0, "depth": 0xFFFFFFFF}


def test_numbers_in_the_browser_are_those_of_the_core_and_highlights_keep_to_them(workspace: Path, origin: str) -> None:
    view = CoreView(workspace, "town", "90-45")
    frame = view.frame
    buffers = {(x, y): buffer for x, y, buffer in view.tiles()}
    known = view.known("building", 3)
    answer = browse(
        "pixels.mjs",
        origin=origin,
        rendering="town",
        view=frame.id,
        zmax=frame.zmax,
        tiles=list(buffers),
        targets=[(place.id, place.position) for place in known],
        size=(WIDTH, HEIGHT),
        picture=picture("pixels.png"),
    )
    assert answer["problems"] == []
    assert sum((buffer["id"] != 0).any() for buffer in buffers.values()) > 10
    for kind, empty in EMPTY.items():
        want = [hashlib.sha256(b[kind].tobytes()).hexdigest() if (b[kind] != empty).any() else None for b in buffers.values()]
        assert [tile for tile, got, hoped in zip(buffers, answer["tiles"][kind], want, strict=True) if got != hoped] == [], kind
    ids = np.pad(view.mosaic("id"), ((HEIGHT, HEIGHT), (WIDTH, WIDTH)))
    assert len(known) == 3
    for place, text in zip(known, answer["changed"], strict=True):
        column, row = view.pixel_of(place.position)
        seen = ids[row + HEIGHT - HEIGHT // 2 :, column + WIDTH - WIDTH // 2 :][:HEIGHT, :WIDTH] == place.id
        changed = np.frombuffer(base64.b64decode(text), np.uint8).reshape(HEIGHT, WIDTH) == 1
        assert seen.sum() > 400
        assert np.argwhere(seen != changed).tolist() == [], place.name
