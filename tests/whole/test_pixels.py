"""Ids and depths reach the browser bit for bit; a highlight changes only the pixels of its object."""

import base64
import hashlib
from pathlib import Path

import numpy as np
import pytest

from tests.whole.browsing import browse, picture
from tests.whole.core_pixels import CoreView

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 701, 501
"""Odd, so that the middle is the centre of a pixel."""
EMPTY = {"id": 0, "depth": 0xFFFFFFFF}


def test_ids_and_depths_equal_those_of_the_core_and_highlights_change_only_their_object(workspace: Path, origin: str) -> None:
    view = CoreView(workspace, "town", "90-45")
    frame = view.frame
    buffers = {(x, y): buffer for x, y, buffer in view.tiles()}
    objects = view.find_objects("building", 3)
    answer = browse(
        "pixels.mjs",
        origin=origin,
        rendering="town",
        view=frame.id,
        zmax=frame.zmax,
        tiles=list(buffers),
        targets=[(place.id, place.position) for place in objects],
        size=(WIDTH, HEIGHT),
        picture=picture("pixels.png"),
    )
    assert answer["problems"] == []
    assert sum((buffer["id"] != 0).any() for buffer in buffers.values()) > 10
    for kind, empty in EMPTY.items():
        expected = [hashlib.sha256(b[kind].tobytes()).hexdigest() if (b[kind] != empty).any() else None for b in buffers.values()]
        assert [tile for tile, got, digest in zip(buffers, answer["tiles"][kind], expected, strict=True) if got != digest] == [], kind
    ids = np.pad(view.mosaic("id"), ((HEIGHT, HEIGHT), (WIDTH, WIDTH)))
    assert len(objects) == 3
    for place, text in zip(objects, answer["changed"], strict=True):
        column, row = view.pixel_of(place.position)
        seen = ids[row + HEIGHT - HEIGHT // 2 :, column + WIDTH - WIDTH // 2 :][:HEIGHT, :WIDTH] == place.id
        changed = np.frombuffer(base64.b64decode(text), np.uint8).reshape(HEIGHT, WIDTH) == 1
        assert seen.sum() > 400
        assert np.argwhere(seen != changed).tolist() == [], place.name
