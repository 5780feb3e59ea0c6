"""Boxes of objects, against brute force."""

import numpy as np

from map3d.registry.object_boxes import object_boxes


def test_boxes_match_brute_force() -> None:
    chance = np.random.default_rng(1)
    points = chance.normal(size=(50, 3))
    triangles = chance.integers(0, 50, size=(200, 3), dtype=np.uint32)
    objects = chance.integers(0, 7, size=200, dtype=np.uint32) * 2
    boxes = object_boxes(points, triangles, objects, 14)
    for number in range(14):
        mine = points[triangles[objects == number]].reshape(-1, 3)
        if len(mine):
            assert np.array_equal(boxes[number], [mine.min(axis=0), mine.max(axis=0)])
        else:
            assert np.all(boxes[number, 0] == np.inf)
            assert np.all(boxes[number, 1] == -np.inf)


def test_objects_without_triangles_have_no_box() -> None:
    boxes = object_boxes(np.zeros((0, 3)), np.zeros((0, 3), np.uint32), np.zeros(0, np.uint32), 2)
    assert np.all(np.isinf(boxes))
