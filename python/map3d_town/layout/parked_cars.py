"""Adds parked cars to the orthophoto."""

import numpy as np

from map3d_town.layout.plan_builder import PlanBuilder
from map3d_town.polygons_2d import Points, contains, left_normal, rectangle

CARS = ("car_white", "car_dark", "car_red", "car_white", "car_dark")


def park_cars(builder: PlanBuilder, outline: Points, start: Points, along: Points, length_m: float, rng: np.random.Generator) -> None:
    """Adds parking spaces side by side from `start`, some with cars, where they are inside the convex outline."""
    heading = left_normal(along)
    for shift in np.arange(1.3, length_m - 1.3, 2.6):
        centre = start + along * shift
        car = rectangle(centre, heading, 4.3, 1.75)
        if contains(outline, car, 0.4).all():
            builder.add_ground(rectangle(centre + along * 1.3, heading, 4.8, 0.12), "mark", "path")
            if rng.random() < 0.65:
                builder.add_ground(car, CARS[int(rng.integers(len(CARS)))], "thing")
                builder.add_ground(rectangle(centre - heading * 0.3, heading, 1.9, 1.5), "car_dark", "mark")
