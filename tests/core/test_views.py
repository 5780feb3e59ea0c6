"""Any view of a scene: brute force at pixel centres, agreement with tiles, cuts, selections, threads, limits."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from map3d import _core

from .built import build_soup

SIZE = (80, 72)
LAYERS = [_core.LayerSpec(kind, "png") for kind in ("color", "normal", "id", "depth")]
Vector = NDArray[np.float64]


@pytest.fixture(scope="module")
def soup(tmp_path_factory: pytest.TempPathFactory) -> tuple[_core.Scene, Vector]:
    """A scene of random triangles with ids 1, 2, … and their corners (n, 3, 3)."""
    rng = np.random.default_rng(15)
    centres = rng.uniform((-60, -60, -20), (60, 60, 40), (500, 3))
    corners = centres[:, None] + rng.normal(0, 1, (500, 3, 3)) * rng.choice([0.5, 3.0, 12.0, 60.0], 500)[:, None, None]
    corners = np.round(corners * 256) / 256
    return build_soup(tmp_path_factory.mktemp("soup"), corners), corners


def axes_towards(forward: Vector, roll_deg: float) -> tuple[Vector, Vector, Vector]:
    forward = forward / np.linalg.norm(forward)
    side = np.cross(forward, (0, 0, 1) if abs(forward[2]) < 0.999 else (0, 1, 0))
    side /= np.linalg.norm(side)
    up = np.cross(side, forward)
    c, s = np.cos(np.radians(roll_deg)), np.sin(np.radians(roll_deg))
    right = c * side + s * up
    return right, np.cross(right, forward), forward


def camera(projection: str, position: Vector, forward: Vector, roll_deg: float = 0.0, near_m: float = 0.5, scale: float = 1.0) -> _core.Camera:
    right, up, forward = axes_towards(np.asarray(forward, float), roll_deg)
    half = scale * (0.9 if projection == "perspective" else 45.0)
    window = (-half, half * 1.1, -half * 0.8, half * 0.85)
    return _core.Camera(projection, tuple(position), tuple(right), tuple(up), tuple(forward), window, near_m, 400.0, *SIZE)


def cameras() -> Iterator[tuple[str, _core.Camera]]:
    rng = np.random.default_rng(3)
    fixed = {
        "level": ((-90.0, 5.0, 8.0), (1.0, 0.1, 0.0), 0.0),
        "from-below": ((10.0, 5.0, -80.0), (0.05, 0.1, 1.0), 25.0),
        "straight-down": ((0.0, 0.0, 120.0), (0.0, 0.0, -1.0), 0.0),
        "rolled": ((60.0, -70.0, 40.0), (-0.6, 0.7, -0.35), 130.0),
        "inside": ((0.0, 0.0, 10.0), (0.3, -1.0, 0.2), -40.0),
    }
    for name, (position, forward, roll) in fixed.items():
        for projection in ("orthographic", "perspective"):
            yield f"{projection}-{name}", camera(projection, np.array(position), np.array(forward), roll)
    for number in range(4):
        for projection in ("orthographic", "perspective"):
            position = rng.uniform(-80, 80, 3)
            forward = rng.uniform(-20, 20, 3) - position
            yield f"{projection}-random-{number}", camera(projection, position, forward, rng.uniform(-180, 180))


def brute_force(view: _core.Camera, corners: Vector) -> tuple[NDArray[np.uint32], Vector, Vector, Vector]:
    """Traces the pixel centres in float64. Returns id, depth along forward, distance to the second surface, and to the nearest edge in pixels."""
    width, height = view.width_px, view.height_px
    left, right_edge, bottom, top = view.window
    x = left + (np.arange(width) + 0.5) * (right_edge - left) / width
    y = top - (np.arange(height) + 0.5) * (top - bottom) / height
    x, y = (a.ravel() for a in np.meshgrid(x, y))
    right, up, forward, position = (np.array(v) for v in (view.right, view.up, view.forward, view.position))
    plane = x[:, None] * right + y[:, None] * up
    perspective = view.projection == "perspective"
    origins = np.broadcast_to(position, plane.shape) if perspective else position + plane
    directions = forward + plane if perspective else np.broadcast_to(forward, plane.shape)
    pixel_m = (right_edge - left) / width
    first, second = np.full(len(x), np.inf), np.full(len(x), np.inf)
    ids, edge = np.zeros(len(x), np.uint32), np.full(len(x), np.inf)
    for number, (a, b, c) in enumerate(corners):
        e1, e2 = b - a, c - a
        p = np.cross(directions, e2)
        det = p @ e1
        with np.errstate(divide="ignore", invalid="ignore"):
            s = origins - a
            u = (s * p).sum(-1) / det
            q = np.cross(s, e1)
            v = (directions * q).sum(-1) / det
            t = q @ e2 / det
        normal = np.cross(e1, e2)
        # Distances from the edges in pixels, roughly, seen along the ray.
        cosine = np.abs(directions @ normal) / (np.linalg.norm(directions, axis=1) * np.linalg.norm(normal))
        heights = np.linalg.norm(normal) / np.linalg.norm([e2, e1, c - b], axis=1)
        margin = np.min(np.abs([u, v, 1 - u - v]) * heights[:, None], axis=0) * cosine
        footprint = pixel_m * np.where(perspective, np.abs(t), 1.0)
        hits = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= view.near_m) & (t <= view.far_m)
        near_edge = (u >= -0.3) & (v >= -0.3) & (u + v <= 1.3) & (margin < 0.1 * footprint) & (t > 0)
        edge[near_edge & (t < first + 1)] = 0
        cut = (np.abs(t - view.near_m) < 0.01) | (np.abs(t - view.far_m) < 0.01)
        edge[(u >= 0) & (v >= 0) & (u + v <= 1) & cut] = 0
        closer = hits & (t < first)
        second = np.where(closer, first, np.where(hits, np.minimum(second, t), second))
        ids[closer] = number + 1
        first = np.where(closer, t, first)
    gap = np.where(np.isfinite(second), second, 1e9) - np.where(np.isfinite(first), first, 0.0)
    return ids.reshape(height, width), first.reshape(height, width), gap.reshape(height, width), edge.reshape(height, width)


@pytest.mark.parametrize("view", [view for _, view in cameras()], ids=[name for name, _ in cameras()])
def test_pixel_centres_show_what_brute_force_finds(soup: tuple[_core.Scene, Vector], view: _core.Camera) -> None:
    scene, corners = soup
    ours = scene.render_view(view, LAYERS)
    ids, depth, gap, edge = brute_force(view, corners)
    use = (edge > 0) & (gap > 0.01)
    assert use.mean() > 0.5, "too few pixels away from edges"
    assert (ids > 0).mean() > 0.2, "the view shows too little"
    wrong = use & (ours["id"] != ids)
    assert wrong.sum() <= 0.002 * use.sum(), f"{wrong.sum()} of {use.sum()} ids differ, first at {np.argwhere(wrong)[:3].tolist()}"
    same = use & (ours["id"] == ids) & (ids > 0)
    tolerance = 0.003 + 2e-3 * np.abs(depth[same]) * (view.projection == "perspective") * 1e-3
    steep = np.abs(ours["depth"][same] - depth[same]) > tolerance
    assert not steep.any(), np.abs(ours["depth"][same] - depth[same]).max()
    assert np.isnan(ours["depth"][ours["id"] == 0]).all()
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    expected = normals[ids[same] - 1]
    towards = view.line_of_sight(0, 0)[1] if view.projection == "orthographic" else None
    rays = np.array(towards) if towards is not None else _directions(view)[same]
    expected = expected * -np.sign((expected * rays).sum(-1))[:, None]
    assert np.abs(ours["normal"][same] - np.round((expected + 1) / 2 * 255)).max() <= 1


def _directions(view: _core.Camera) -> Vector:
    rows = [[view.line_of_sight(i + 0.5, j + 0.5)[1] for i in range(view.width_px)] for j in range(view.height_px)]
    return np.array(rows)


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_picked_hits_are_those_of_the_image(soup: tuple[_core.Scene, Vector], projection: str) -> None:
    scene, corners = soup
    view = camera(projection, np.array((60.0, -70.0, 40.0)), np.array((-0.6, 0.7, -0.35)), 30.0)
    image = scene.render_view(view, LAYERS)
    agree = 0
    pixels = [(i, j) for j in range(3, SIZE[1], 7) for i in range(2, SIZE[0], 9)]
    for i, j in pixels:
        hits = scene.pick_ray(view, i + 0.5, j + 0.5, 5)
        distances = [d for _, d, _, _ in hits]
        assert distances == sorted(distances)
        assert len(hits) <= 5
        agree += (hits[0][0] if hits else 0) == image["id"][j, i]
        for id, distance, position, normal in hits:
            origin, direction = (np.array(v) for v in view.line_of_sight(i + 0.5, j + 0.5))
            assert np.allclose(origin + direction / np.linalg.norm(direction) * distance, position, atol=1e-6)
            assert abs(np.dot(position - corners[id - 1, 0], normal)) < 1e-6
            assert np.dot(direction, normal) <= 0
    assert agree >= 0.97 * len(pixels)


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_regions_and_threads_give_the_same_bytes(soup: tuple[_core.Scene, Vector], projection: str) -> None:
    scene, _ = soup
    view = camera(projection, np.array((60.0, -70.0, 40.0)), np.array((-0.6, 0.7, -0.35)), 30.0)
    whole = scene.render_view(view, LAYERS)
    threaded = scene.render_view(view, LAYERS, threads=3)
    part = scene.render_view(view, LAYERS, region=(13, 5, 60, 61))
    for name, array in whole.items():
        assert np.array_equal(array, threaded[name], equal_nan=name == "depth")
        assert np.array_equal(array[5:66, 13:73], part[name], equal_nan=name == "depth")


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_a_box_cuts_and_objects_select(soup: tuple[_core.Scene, Vector], projection: str) -> None:
    scene, _ = soup
    view = camera(projection, np.array((60.0, -70.0, 40.0)), np.array((-0.6, 0.7, -0.35)))
    box = ((-20.0, -30.0, -5.0), (25.0, 20.0, 30.0))
    cut = scene.render_view(view, LAYERS, box=box)
    shown = np.argwhere(cut["id"] > 0)
    assert len(shown) > 500
    for j, i in shown[::40]:
        origin, direction = (np.array(v) for v in view.line_of_sight(i + 0.5, j + 0.5))
        position = origin + direction * float(cut["depth"][j, i])
        assert np.all(position >= np.array(box[0]) - 0.3)
        assert np.all(position <= np.array(box[1]) + 0.3)
        assert scene.pick_ray(view, i + 0.5, j + 0.5, box=box)[0][0] == cut["id"][j, i] or _is_edge(cut["id"], i, j)
    all_ids = np.unique(scene.render_view(view, LAYERS)["id"])
    chosen = all_ids[all_ids > 0][::3].astype(np.uint32)
    selected = scene.render_view(view, LAYERS, objects=chosen)
    assert set(np.unique(selected["id"])) == {0, *chosen.tolist()}
    assert scene.render_view(view, LAYERS, objects=np.zeros(0, np.uint32))["id"].max() == 0


def _is_edge(ids: NDArray[np.uint32], i: int, j: int) -> bool:
    return len(np.unique(ids[max(0, j - 1) : j + 2, max(0, i - 1) : i + 2])) > 1


def test_an_aligned_camera_shows_the_tile(soup: tuple[_core.Scene, Vector]) -> None:
    scene, _ = soup
    frame = _core.Frame(30.0, 40.0, -70.0, 60.0, -250.0, 128.0, 256, 0)
    tile = scene.gbuffer(frame, 0, 0)
    a, p = np.radians(30.0), np.radians(40.0)
    right = np.array((np.cos(a), np.sin(a), 0.0))
    forward = np.array((-np.cos(p) * np.sin(a), np.cos(p) * np.cos(a), -np.sin(p)))
    up = np.cross(right, forward)
    position = right * -70.0 + up * 60.0 + forward * -250.0
    view = _core.Camera("orthographic", tuple(position), tuple(right), tuple(up), tuple(forward), (0.0, 128.0, -128.0, 0.0), 0.0, 4000.0, 256, 256)
    ours = scene.render_view(view, LAYERS)
    # The camera's numbers are rounded otherwise than the frame's: a corner on the boundary of two lattice steps may snap to the other one.
    same = ours["id"] == tile["id"]
    assert same.mean() > 0.9999
    units = np.where(np.isnan(ours["depth"]), -1, ours["depth"] * 1024.0)
    stored = np.where(tile["id"] == 0, -1, tile["depth"].astype(np.float64))
    assert np.abs(units - stored)[same].max() <= 1
    normals = np.where(tile["id"][..., None] > 0, np.round((tile["normal"] / 32767.0 + 1) / 2 * 255), 0)
    assert np.abs(ours["normal"].astype(float) - normals)[same].max() <= 1


@pytest.mark.parametrize("samples", [1, 4, 16])
def test_fewer_samples_change_colours_at_edges_only(soup: tuple[_core.Scene, Vector], samples: int) -> None:
    scene, _ = soup
    view = camera("perspective", np.array((60.0, -70.0, 40.0)), np.array((-0.6, 0.7, -0.35)))
    full, fewer = scene.render_view(view, LAYERS), scene.render_view(view, LAYERS, samples=samples)
    for name in ("id", "normal", "depth"):
        assert np.array_equal(full[name], fewer[name], equal_nan=name == "depth")
    alphas = set(np.unique(fewer["color"][..., 3]).tolist())
    assert alphas <= {round(255 * k / samples) for k in range(samples + 1)}


BAD = [
    {"position": (float("nan"), 0, 0)},
    {"position": (float("inf"), 0, 0)},
    {"position": (1e30, 0, 0)},
    {"forward": (0, 0, 0)},
    {"up": (0, 1, 0)},
    {"right": (-1, 0, 0)},
    {"window": (1, 1, -1, 1)},
    {"window": (-1, 1, float("nan"), 1)},
    {"near_m": 0.0},
    {"near_m": 500.0},
    {"far_m": float("inf")},
    {"width_px": 0},
    {"height_px": -5},
    {"width_px": 4097},
    {"projection": "fisheye"},
]


@pytest.mark.parametrize("change", BAD, ids=[str(change) for change in BAD])
def test_hostile_numbers_are_refused(change: dict) -> None:
    good = {
        "projection": "perspective",
        "position": (0, 0, 0),
        "right": (1, 0, 0),
        "up": (0, 0, 1),
        "forward": (0, 1, 0),
        "window": (-1, 1, -1, 1),
        "near_m": 0.1,
        "far_m": 100.0,
        "width_px": 64,
        "height_px": 64,
    }
    _core.Camera(**good)
    with pytest.raises(_core.InvalidArgument):
        _core.Camera(**{**good, **change})


def test_misuse_and_passed_deadlines_raise(soup: tuple[_core.Scene, Vector]) -> None:
    scene, _ = soup
    view = camera("perspective", np.array((60.0, -70.0, 40.0)), np.array((-0.6, 0.7, -0.35)))
    wrong: list[dict] = [
        {"samples": 3},
        {"threads": 0},
        {"deadline_s": 0.0},
        {"deadline_s": float("nan")},
        {"box": ((0.0, 0.0, 0.0), (-1.0, 1.0, 1.0))},
        {"box": ((0.0, 0.0, 0.0), (float("inf"), 1.0, 1.0))},
        {"region": (0, 0, 0, 5)},
        {"region": (75, 0, 7, 5)},
    ]
    for arguments in wrong:
        with pytest.raises(_core.InvalidArgument):
            scene.render_view(view, LAYERS, **arguments)
    with pytest.raises(_core.InvalidArgument, match="Depth2"):
        scene.render_view(view, [_core.LayerSpec("depth2", "png")])
    with pytest.raises(_core.LimitError, match=r"deadline_s = 0\.000000001"):
        scene.render_view(view, LAYERS, deadline_s=1e-9)
    for arguments in ({"x_px": -1.0}, {"x_px": float("nan")}, {"count": 0}, {"count": 10_001}):
        with pytest.raises(_core.InvalidArgument):
            scene.pick_ray(view, **{"x_px": 1.0, "y_px": 1.0, **arguments})


def test_extreme_cameras_render(soup: tuple[_core.Scene, Vector]) -> None:
    scene, _ = soup
    axes = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0))
    extremes = [
        ("orthographic", (0.0, -1e9, 0.0), (-1e9, 1e9, -1e9, 1e9), -1e9, 1e9),
        ("orthographic", (0.0, 0.0, 0.0), (0.0, 1e-8, 0.0, 1e-8), -1e9, 1e9),
        ("perspective", (0.0, -1e9, 0.0), (-1e9, 1e9, -1e9, 1e9), 0.001, 1e9),
        ("perspective", (0.0, 0.0, 5.0), (-1e6, 1e6, -1e6, 1e6), 0.001, 1e9),
        ("perspective", (0.0, 0.0, 5.0), (0.0, 1e-8, 0.0, 1e-8), 0.001, 1e9),
    ]
    for projection, position, window, near_m, far_m in extremes:
        view = _core.Camera(projection, position, *axes, window, near_m, far_m, 70, 50)
        assert scene.render_view(view, LAYERS, deadline_s=60)["id"].shape == (50, 70)
        scene.pick_ray(view, 35.0, 25.0, 3)


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_a_pixel_is_lit_if_nothing_is_between_it_and_the_sun(soup: tuple[_core.Scene, Vector], projection: str) -> None:
    scene, _ = soup
    sun = np.array((0.48, -0.6, 0.64))
    view = camera(projection, np.array((60.0, -70.0, 40.0)), np.array((-0.6, 0.7, -0.35)), 20.0)
    layers = [*LAYERS, _core.LayerSpec("sun", "png", suns=[tuple(sun)]), _core.LayerSpec("ao", "png", radius_m=20.0)]
    image = scene.render_view(view, layers)
    agree, tried = 0, 0
    for j in range(2, SIZE[1], 5):
        for i in range(1, SIZE[0], 5):
            hits = scene.pick_ray(view, i + 0.5, j + 0.5)
            if not hits or image["sun"][j, i] not in (0, 255) or _is_edge(image["id"], i, j):
                continue
            _, _, position, normal = hits[0]
            start = np.array(position) + np.array(normal) / 64
            right, up, forward = axes_towards(sun, 0.0)
            towards = _core.Camera("orthographic", tuple(start), tuple(right), tuple(up), tuple(forward), (-0.5, 0.5, -0.5, 0.5), 0.0, 1e4, 1, 1)
            lit = np.dot(normal, sun) > 0 and not scene.pick_ray(towards, 0.5, 0.5)
            agree += (image["sun"][j, i] == 255) == lit
            tried += 1
    assert tried > 60
    assert agree >= 0.97 * tried
    covered = image["id"] > 0
    assert image["ao"][covered].min() < 200
    assert (image["ao"][~covered & (image["color"][..., 3] == 0)] == 255).all()
