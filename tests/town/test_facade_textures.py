"""Drawing of facade and roof textures."""

import numpy as np
import pytest

from map3d_town.models.building_model import AtlasTexture
from map3d_town.textures.facade_textures import draw_texture, seams_px


@pytest.mark.parametrize(("width_px", "step_px"), [(69, 4.6), (84, 5.6), (134, 5.359999999999999), (12, 3.0), (3, 40.0)])
def test_seams_of_metal_roof_are_inside_its_width(width_px, step_px):
    seam = seams_px(width_px, step_px)
    assert seam[0] == 0
    assert 0 <= width_px - 1 - seam[-1] < np.ceil(step_px) + 1
    texture = AtlasTexture("roof", width_px / 10, 2.0, ((120, 130, 140),), traits=frozenset({"metal"}))
    assert draw_texture(texture, width_px, 20, step_px / 0.6, 5).shape == (20, width_px)
