"""Makes building parts from outlines: rows, rings, hipped and flat roofs, spires, vaults."""

import math
from dataclasses import replace

import numpy as np

from map3d_town.layout.town_plan import BuildingPart
from map3d_town.polygons_2d import Points, left_normal, offset, unit

Profile = tuple[tuple[float, float], ...]
FLAT, SHED, GABLE, HIP, HALF_HIP, MANSARD = "1000", "1010", "1030", "1040", "1050", "1060"


def gable_profile(depth_m: float, pitch_deg: float) -> Profile:
    return ((0.0, 0.0), (0.5, depth_m / 2 * math.tan(math.radians(pitch_deg))), (1.0, 0.0))


def mansard_profile(depth_m: float, run_m: float = 1.2, rise_m: float = 2.7, pitch_deg: float = 24.0) -> Profile:
    top = rise_m + (depth_m / 2 - run_m) * math.tan(math.radians(pitch_deg))
    return ((0.0, 0.0), (run_m / depth_m, rise_m), (0.5, top), (1 - run_m / depth_m, rise_m), (1.0, 0.0))


def saw_tooth_profile(count: int, rise_m: float) -> Profile:
    points: list[tuple[float, float]] = []
    for i in range(count):
        points += [(i / count, 0.0), ((i + 1) / count, rise_m)]
    return tuple(points)


def vault_profile(rise_m: float, steps: int = 8) -> Profile:
    """Returns the profile of a barrel vault over the whole depth."""
    angles = [math.pi * i / steps for i in range(steps + 1)]
    return tuple((0.5 - 0.5 * math.cos(a), rise_m * math.sin(a)) for a in angles)


def dome_profile(rise_m: float, steps: int = 6) -> Profile:
    """Returns the profile of a dome from its edge (t = 0) to its centre (t = 1)."""
    angles = [math.pi / 2 * i / steps for i in range(steps + 1)]
    return tuple((1 - math.cos(a), rise_m * math.sin(a)) for a in angles)


def row_part(a: Points, b: Points, depth_m: float, profile: Profile, part: BuildingPart, sides: tuple[str, str, str, str]) -> BuildingPart:
    """Returns a part with its eave from a to b, left to right seen from outside. `sides`: front, back, end at a, end at b."""
    inward = left_normal(unit(b - a)) * depth_m
    return replace(part, front=np.array([a, b]), back=np.array([a + inward, b + inward]), profile=profile, sides=sides)


def gable_front_part(a: Points, b: Points, depth_m: float, profile: Profile, part: BuildingPart, sides: tuple[str, str, str, str]) -> BuildingPart:
    """Returns a part like `row_part` with the ridge across. `sides`: side at b, side at a, gable at the front, gable at the back."""
    inward = left_normal(unit(b - a)) * depth_m
    front, back = np.array([b, b + inward]), np.array([a, a + inward])
    return replace(part, front=front, back=back, profile=profile, sides=sides)


def hipped_part(rectangle: Points, pitch_deg: float, part: BuildingPart, steep: bool = False) -> BuildingPart:
    """Returns a part with a hipped roof, a pyramid over a square; `steep`: with a mansard below."""
    a, b, c, d = rectangle
    length, width = float(np.hypot(*(b - a))), float(np.hypot(*(d - a)))
    if width > length:
        return hipped_part(np.roll(rectangle, -1, axis=0), pitch_deg, part, steep)
    along, half = unit(b - a), width / 2
    start, write_foot = (a + d) / 2 + along * half, (b + c) / 2 - along * half
    slope = math.tan(math.radians(pitch_deg))
    profile: Profile = ((0.0, 0.0), (1.0, half * slope))
    if steep:
        profile = ((0.0, 0.0), (1.1 / half, 2.6), (1.0, 2.6 + (half - 1.1) * math.tan(math.radians(24))))
    back = np.array([start, write_foot, write_foot, start])
    kind = MANSARD if steep else HIP
    return replace(part, front=rectangle, back=back, profile=profile, closed=True, roof_type=kind, sides=part.sides or ("street",) * 4)


def flat_part(polygon: Points, part: BuildingPart, parapet_m: float = 0.55) -> BuildingPart:
    """Returns a part with a flat roof behind a parapet."""
    profile: Profile = ((0.0, parapet_m), (1.0, parapet_m), (1.0, 0.0))
    back = offset(polygon, 0.3)
    return replace(part, front=polygon, back=back, profile=profile, closed=True, overhang_m=0.0, roof_type=FLAT)


def spire_part(polygon: Points, profile: Profile, part: BuildingPart) -> BuildingPart:
    """Returns a part whose roof rises to a point above the mean of its corners."""
    back = np.repeat(polygon.mean(axis=0)[None, :], len(polygon), axis=0)
    return replace(part, front=polygon, back=back, profile=profile, closed=True, roof_type="1070")


def ring_part(polygon: Points, depth_m: float, profile: Profile, part: BuildingPart) -> BuildingPart:
    """Returns a part of wings around a courtyard."""
    n = len(polygon)
    sides = ("street",) * n + ("yard",) * n
    return replace(part, front=polygon, back=offset(polygon, depth_m), profile=profile, closed=True, hollow=True, sides=sides)


def part_without_outline(eave_m: float, storeys: int, facade_kind: str, cover: str, overhang_m: float = 0.0, roof_type: str = GABLE) -> BuildingPart:
    """Returns a part without outline, for use with `replace`."""
    empty = np.zeros((0, 2))
    return BuildingPart(empty, empty, (), eave_m, storeys=storeys, facade_kind=facade_kind, cover=cover, overhang_m=overhang_m, roof_type=roof_type)
