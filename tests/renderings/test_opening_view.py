"""A map opens at objects, near the middle of the content where there are some."""

import numpy as np
import pytest

from map3d.registry import NewObject, Registry
from map3d.renderings.opening_view import IN_VIEW, find_opening, read_objects_box, read_opening

LAND = ((0.0, 0.0, 0.0), (1000.0, 600.0, 40.0))


def houses(low, high, count, seed=7):
    """Returns boxes of 10 m in a rectangle."""
    random = np.random.default_rng(seed)
    corners = np.column_stack([random.uniform(low[0], high[0], count), random.uniform(low[1], high[1], count), np.full(count, 2.0)])
    return np.hstack([corners, corners + 10.0])


def test_a_town_opens_in_its_middle():
    opening = find_opening(houses((0, 0), (980, 580), 300), LAND)
    assert opening.position == (500.0, 300.0, 20.0)
    assert 50 < opening.radius_m < 200


def test_two_islands_open_on_one_of_them():
    boxes = np.vstack([houses((0, 0), (200, 580), 60), houses((780, 0), (980, 580), 40)])
    opening = find_opening(boxes, LAND)
    x, y, z = opening.position
    near = np.hypot(boxes[:, 0] + 5 - x, boxes[:, 1] + 5 - y) <= opening.radius_m
    assert x < 250 or x > 750
    assert z == 2.0
    assert near.sum() >= 20


@pytest.mark.parametrize("count", [1, 2, 5])
def test_all_of_few_objects_are_in_view(count):
    boxes = houses((100, 100), (900, 500), count)
    opening = find_opening(boxes, LAND)
    x, y, _ = opening.position
    assert max(np.abs(boxes[:, [0, 3]] - x).max(), np.abs(boxes[:, [1, 4]] - y).max()) <= opening.radius_m


def test_ground_and_what_lies_outside_do_not_count():
    ground = np.array([[0, 0, 0, 1000, 600, 5]])
    outside = houses((5000, 0), (5200, 500), 100)
    assert find_opening(np.vstack([ground, outside]), LAND) is None
    assert find_opening(np.zeros((0, 6)), LAND) is None


def test_a_decided_position_stays():
    opening = find_opening(houses((0, 0), (200, 580), 60), LAND, position=(700.0, 300.0, 9.0))
    assert opening.position == (700.0, 300.0, 9.0)
    assert opening.radius_m > 480


def test_objects_are_read_and_sampled_without_the_ground(tmp_path):
    boxes = [((float(k), 0.0, 0.0), (float(k) + 5, 5.0, 9.0)) for k in range(0, 900, 9)]
    with Registry(tmp_path / "registry.sqlite") as registry:
        rows = [NewObject(f"h{k}", "building", box=box) for k, box in enumerate(boxes)]
        registry.put_asset("town", [*rows, NewObject("lake", "water_body", box=((0.0, 0.0, 0.0), (300.0, 300.0, 1.0)))])
        assert len(registry.sample_boxes(("water_body",), 1)) == len(boxes)
        assert len(registry.sample_boxes((), 10)) == 10
        assert read_opening(registry, LAND).radius_m == find_opening([[*low, *high] for low, high in boxes], LAND, IN_VIEW).radius_m


def test_few_objects_far_from_each_other_open_at_one(tmp_path):
    far = [[0, 0, 0, 10, 10, 8], [900, 500, 0, 910, 510, 8]]
    opening = find_opening(far, LAND)
    assert opening.position[:2] in ((5.0, 5.0), (905.0, 505.0))
    assert opening.radius_m < 10
    near = find_opening([[100, 100, 0, 150, 130, 8], [190, 110, 0, 211, 131, 21]], LAND)
    assert near.position == (155.5, 115.5, 20.0)
    assert near.radius_m > 55


def test_the_box_of_the_objects_lies_within_the_content(tmp_path):
    with Registry(tmp_path / "registry.sqlite") as registry:
        assert read_objects_box(registry, LAND) is None
        boxes = (((10.0, 20.0, 1.0), (30.0, 40.0, 9.0)), ((-500.0, 50.0, 2.0), (60.0, 70.0, 5.0)))
        rows = [NewObject(f"h{k}", "building", box=box) for k, box in enumerate(boxes)]
        registry.put_asset("town", [*rows, NewObject("lake", "water_body", box=((0.0, 0.0, 0.0), (900.0, 300.0, 1.0)))])
        assert read_objects_box(registry, LAND) == ((0.0, 20.0, 1.0), (60.0, 70.0, 9.0))
