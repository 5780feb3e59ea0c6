"""Any view agrees with Mitsuba's perspective and orthographic sensors: depth, normal and id at pixel centres, colour over pixel boxes."""

import numpy as np
import pytest
from numpy.typing import NDArray

from map3d import _core

from .conftest import OracleScene
from .image_agreement import edge_mask, psnr, srgb_from_linear

mitsuba = pytest.importorskip("mitsuba", reason="Mitsuba 3 is not installed; pip install -r requirements/peers.lock")
try:
    mitsuba.set_variant("llvm_ad_rgb")
except ImportError:
    pytest.skip("Mitsuba 3 finds no LLVM library; apt install libllvm15", allow_module_level=True)

from .camera_views import CameraViews, look  # noqa: E402
from .mitsuba_scene import MitsubaScene  # noqa: E402

LAYERS = [_core.LayerSpec(kind, "png") for kind in ("color", "normal", "id", "depth")]
SIZE = (320, 240)
OTHERS = ("perspective-street", "perspective-below", "perspective-rolled", "orthographic-level", "orthographic-below")
VIEWS = ["perspective-air", *(pytest.param(view, marks=pytest.mark.third_party) for view in OTHERS)]
COPLANAR_M = 0.01


@pytest.fixture(scope="module")
def views(town: OracleScene) -> CameraViews:
    return CameraViews(MitsubaScene(town.assets, np.array(town.scene.origin), town.texture))


def camera(name: str, scene: _core.Scene) -> _core.Camera:
    lo, hi = (np.array(corner) for corner in scene.box)
    middle, size = (lo + hi) / 2, float(np.linalg.norm((hi - lo)[:2]))
    places: dict[str, tuple[NDArray[np.float64], tuple[float, float, float], float]] = {
        "air": (middle + np.array((-0.5 * size, -0.4 * size, 0.4 * size)), (0.7, 0.6, -0.55), 0.0),
        "street": (np.array((middle[0], lo[1] - 15.0, lo[2] + 8.0)), (0.05, 1.0, 0.05), 0.0),
        "below": (middle + np.array((0.0, 0.0, -0.6 * size)), (0.1, 0.2, 1.0), 0.0),
        "rolled": (middle + np.array((0.4 * size, -0.3 * size, 0.25 * size)), (-0.7, 0.5, -0.4), 50.0),
        "level": (middle + np.array((0.0, -size, 0.0)), (0.1, 1.0, 0.0), 0.0),
    }
    kind, place = name.split("-")
    position, forward, roll_deg = places[place]
    half = 0.6 if kind == "perspective" else size * 0.2
    return look(kind, position, forward, roll_deg, half, SIZE)


@pytest.mark.parametrize("name", VIEWS)
def test_depth_normal_and_id_agree_away_from_edges(town: OracleScene, views: CameraViews, name: str) -> None:
    view = camera(name, town.scene)
    # Without the ground plane, which Mitsuba lacks.
    ours, theirs = town.scene.render_view(view, LAYERS, objects=views.ids), views.hits(view)
    edges = edge_mask(theirs.id, theirs.normal, theirs.depth)
    use = ~edges & (theirs.second > COPLANAR_M) & np.isfinite(theirs.depth)
    assert use.sum() > 2_000
    share = {
        "id": (ours["id"] == theirs.id)[use].mean(),
        "depth": (np.abs(ours["depth"] - theirs.depth) <= 0.005 + 2e-5 * theirs.depth)[use].mean(),
        "normal": ((ours["normal"] / 127.5 - 1) * theirs.normal).sum(-1)[use].__ge__(0.99).mean(),
    }
    print(f"{name}: {use.sum()} pixels, agreement {share}")
    assert min(share.values()) >= 0.998, share


@pytest.mark.parametrize("name", VIEWS)
def test_colour_is_the_mean_over_the_pixel_box(town: OracleScene, views: CameraViews, name: str) -> None:
    view = camera(name, town.scene)
    ours, hits = town.scene.render_view(view, LAYERS, objects=views.ids), views.hits(view)
    theirs = srgb_from_linear(views.albedo(view, samples=512))
    use = (ours["color"][..., 3] == 255) & (hits.second > COPLANAR_M)
    assert use.mean() > 0.1
    quality = psnr(ours["color"][..., :3][use] / 255.0, theirs[use])
    print(f"{name}: PSNR {quality:.1f} dB over {use.sum()} pixels")
    assert quality >= 33
