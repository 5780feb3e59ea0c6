"""The core agrees with Mitsuba 3 at pixel centres and over pixel boxes."""

import numpy as np
import pytest

from map3d.geometry.core_frame import core_frame

from .conftest import OracleScene
from .image_agreement import edge_mask, gradient_energy, psnr, srgb_from_linear

mitsuba = pytest.importorskip("mitsuba", reason="Mitsuba 3 is not installed; pip install -r requirements/peers.lock")
try:
    mitsuba.set_variant("llvm_ad_rgb")
except ImportError:
    pytest.skip("Mitsuba 3 finds no LLVM library; apt install libllvm15", allow_module_level=True)

from .mitsuba_scene import MitsubaScene  # noqa: E402

DEPTH_M = 0.005
COPLANAR_M = 0.01
VIEWS = ["30-45", "30-10", "30-22.5", "30-90"]
FIRST_AND_OTHERS = [VIEWS[0], *(pytest.param(view, marks=pytest.mark.third_party) for view in VIEWS[1:])]


@pytest.fixture(scope="session", params=["town", pytest.param("ingolstadt", marks=pytest.mark.third_party)])
def pair(request: pytest.FixtureRequest) -> tuple[OracleScene, MitsubaScene]:
    oracle: OracleScene = request.getfixturevalue(request.param)
    return oracle, MitsubaScene(oracle.assets, np.array(oracle.scene.origin), oracle.texture)


@pytest.mark.parametrize("view", FIRST_AND_OTHERS)
def test_depth_normal_and_id_agree_away_from_edges(pair: tuple[OracleScene, MitsubaScene], view: str) -> None:
    oracle, mitsuba = pair
    frame = oracle.frames[view]
    good = {"depth": 0, "id": 0, "normal": 0}
    counted = 0
    for x, y in oracle.busiest_tiles(view, 4):
        ours = oracle.scene.gbuffer(core_frame(frame), x, y)
        theirs = mitsuba.hits(frame, x, y)
        theirs_hit = np.isfinite(theirs.depth)
        grounded = ours["id"] == _ground_id(oracle)
        use = ~edge_mask(theirs.id, theirs.normal, theirs.depth) & (theirs.second > COPLANAR_M) & theirs_hit & ~grounded
        counted += use.sum()
        depth = ours["depth"] / 1024.0
        good["depth"] += (np.abs(depth - theirs.depth)[use] <= DEPTH_M).sum()
        good["id"] += (ours["id"] == theirs.id)[use].sum()
        normal = ours["normal"] / 32767.0
        good["normal"] += ((normal * theirs.normal).sum(-1)[use] >= 0.9999).sum()
    assert counted > 20_000
    shares = {name: float(count / counted) for name, count in good.items()}
    print(f"{view}: {counted} pixels, agreement {shares}")
    assert min(shares.values()) >= 0.999, shares


@pytest.mark.parametrize("view", FIRST_AND_OTHERS)
def test_colour_is_the_mean_over_the_pixel_box(pair: tuple[OracleScene, MitsubaScene], view: str) -> None:
    oracle, mitsuba = pair
    frame = oracle.frames[view]
    (tile,) = oracle.busiest_tiles(view, 1)
    ours = oracle.scene.gbuffer(core_frame(frame), *tile)
    theirs = srgb_from_linear(mitsuba.albedo(frame, *tile, samples=1024))
    mine = srgb_from_linear(ours["color"][..., :3] / 65535.0)
    hits = mitsuba.hits(frame, *tile)
    use = _without_ground(ours["id"] == _ground_id(oracle)) & (hits.second > COPLANAR_M)
    assert use.mean() > 0.2
    quality = psnr(mine[use], theirs[use])
    blank = np.where(use[..., None], 1.0, 0.0)
    sharpness = gradient_energy(mine * blank) / gradient_energy(theirs * blank)
    print(f"{view}: PSNR {quality:.1f} dB, gradient energy ratio {sharpness:.3f}")
    assert quality >= 35
    assert 0.9 <= sharpness <= 1.1


def _ground_id(oracle: OracleScene) -> int:
    """Returns the id of the ground plane, which only the core has; 0xFFFFFFFF if it is not visible."""
    known = set(np.concatenate([asset.ids for asset in oracle.assets]).tolist())
    seen = {
        int(i)
        for view in VIEWS
        for x, y in oracle.busiest_tiles(view, 1)
        for i in np.unique(oracle.scene.gbuffer(core_frame(oracle.frames[view]), x, y)["id"])
    }
    unknown = seen - known - {0}
    assert len(unknown) <= 1
    return unknown.pop() if unknown else 0xFFFFFFFF


def _without_ground(ground: np.ndarray) -> np.ndarray:
    """Returns the pixels without ground plane in their 3 × 3 neighbourhood."""
    wide = np.pad(ground, 1)
    near = np.zeros_like(wide)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            near |= np.roll(wide, (dy, dx), (0, 1))
    return ~near[1:-1, 1:-1]
