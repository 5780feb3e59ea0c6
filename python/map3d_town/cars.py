"""Parked cars in the orthophoto."""

import numpy as np
from numpy.typing import NDArray

from map3d_town.plane import contains, left, rectangle
from map3d_town.sketch import Sketch

Points = NDArray[np.float64]
CARS = ("car_white", "car_dark", "car_red", "car_white", "car_dark")


def park_cars(sketch: Sketch, outline: Points, start: Points, along: Points, length_m: float, rng: np.random.Generator) -> None:
    """Cars side by side from `start` on, with gaps, where they lie inside the convex outline."""
    heading = left(along)
    for shift in np.arange(1.3, length_m - 1.3, 2.6):
        centre = start + along * shift
        car = rectangle(centre, heading, 4.3, 1.75)
        if contains(outline, car, 0.4).all():
            sketch.patch(rectangle(centre + along * 1.3, heading, 4.8, 0.12), "mark", "path")
            if rng.random() < 0.65:
                sketch.patch(car, CARS[int(rng.integers(len(CARS)))], "thing")
                sketch.patch(rectangle(centre - heading * 0.3, heading, 1.9, 1.5), "car_dark", "mark")
