"""A browser clicks on buildings of a generated town, at positions computed by the core."""

from pathlib import Path

import numpy as np
import pytest

from tests.whole.browsing import browse, picture
from tests.whole.core_pixels import CoreView

pytestmark = pytest.mark.browser

VIEW = "90-45"


def test_click_on_a_building_returns_its_gml_id_and_position(workspace: Path, origin: str) -> None:
    view = CoreView(workspace, "town", VIEW)
    objects = view.find_objects("building", 3)
    assert objects
    places = [place.position for place in objects]
    answer = browse("browse.mjs", origin=origin, rendering="town", view=VIEW, positions=places, picture=picture("whole.png"))
    assert answer["problems"] == []
    for place, click in zip(objects, answer["clicks"], strict=True):
        assert (click["id"], click["name"], click["approximate"]) == (place.id, place.name, False)
        assert np.linalg.norm(np.array(click["position"]) - place.position) <= 2 * view.record.res_m
