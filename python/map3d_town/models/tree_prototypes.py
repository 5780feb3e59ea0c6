"""Prototypes of trees, of height 1: a trunk and textured leaf cards."""

import numpy as np

from map3d_town.models.building_model import Color
from map3d_town.polygons_2d import Points

SPECIES: dict[str, tuple[float, float, Color, str]] = {
    "linden": (0.34, 0.24, (88, 124, 52), "round"), "chestnut": (0.40, 0.22, (70, 106, 44), "round"),
    "apple": (0.44, 0.26, (112, 142, 70), "round"), "poplar": (0.15, 0.12, (96, 126, 58), "column"),
    "fir": (0.24, 0.10, (44, 78, 52), "cone"), "cypress": (0.11, 0.06, (48, 74, 44), "column"),
    "pine": (0.42, 0.62, (66, 98, 50), "umbrella"), "olive": (0.42, 0.30, (134, 146, 104), "round"),
}  # fmt: skip
"""By species: crown radius and trunk height as fractions of the height, crown colour, silhouette."""


def leaf_cards(species: str) -> list[tuple[Points, Points, str]]:
    """Returns the leaf cards of a tree of height 1 at the origin: ring (4, 3), texture coordinates (4, 2), texture name.

    Four upright cards through the trunk, and nearly horizontal ones at several heights, so that the crown looks full from all sides.
    """
    radius, trunk_height, _, shape = SPECIES[species]
    low, quads = trunk_height * 0.8, []
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    for i in range(4):
        a = np.pi * i / 4
        side = np.array([np.cos(a), np.sin(a), 0.0]) * radius
        foot, top = np.array([0, 0, low]), np.array([0, 0, 1.0])
        quads.append((np.array([foot - side, foot + side, top + side, top - side]), square, f"{species}_side"))
    for i, (level, share) in enumerate(_levels(shape)):
        z, r, turn = low + (1 - low) * level, radius * share, 0.5 * i
        x, y = np.array([np.cos(turn), np.sin(turn), 0.12]) * r, np.array([-np.sin(turn), np.cos(turn), -0.1]) * r
        centre = np.array([0, 0, z])
        quads.append((np.array([centre - x - y, centre + x - y, centre + x + y, centre - x + y]), square, f"{species}_top"))
    return [(ring.round(5), st, name) for ring, st, name in quads]


def _levels(shape: str) -> tuple[tuple[float, float], ...]:
    """Returns height and width of the horizontal cards as fractions of the crown."""
    if shape == "cone":
        return ((0.12, 0.95), (0.34, 0.74), (0.56, 0.5), (0.78, 0.26))
    if shape == "column":
        return ((0.25, 0.95), (0.55, 0.95), (0.8, 0.7))
    return ((0.28, 0.9), (0.5, 1.0), (0.7, 0.86), (0.87, 0.55))


def trunk_faces(species: str) -> list[Points]:
    """Returns the six quadrilaterals of the trunk of a tree of height 1."""
    radius, height = 0.022, SPECIES[species][1] + 0.12
    angle = np.arange(7) * (np.pi / 3)
    low = np.stack([np.cos(angle) * radius, np.sin(angle) * radius, np.full(7, -0.03)], axis=1)
    high = np.stack([np.cos(angle) * radius * 0.6, np.sin(angle) * radius * 0.6, np.full(7, height)], axis=1)
    return [np.array([low[i], low[i + 1], high[i + 1], high[i]]).round(5) for i in range(6)]
