"""A made-up town, imported, rendered and served by the command line; a browser clicks on buildings whose place is known."""

from pathlib import Path

import numpy as np
import pytest

from tests.whole.browsing import browse, picture
from tests.whole.core_pixels import CoreView

pytestmark = pytest.mark.browser

VIEW = "90-45"


def test_a_click_on_a_known_building_gives_its_gml_id_and_position(workspace: Path, origin: str) -> None:
    view = CoreView(workspace, "town", VIEW)
    known = view.known("building", 3)
    assert known
    places = [place.position for place in known]
    answer = browse("browse.mjs", origin=origin, rendering="town", view=VIEW, positions=places, picture=picture("whole.png"))
    assert answer["problems"] == []
    for place, click in zip(known, answer["clicks"], strict=True):
        assert (click["id"], click["name"], click["approximate"]) == (place.id, place.name, False)
        assert np.linalg.norm(np.array(click["position"]) - place.position) <= 2 * view.record.res_m
