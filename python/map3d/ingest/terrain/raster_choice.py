"""Chooses which rasters of a terrain give its heights and its colours where several could: by their roles, what they cover, and their heights."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from map3d.ingest.findings import finding
from map3d.ingest.terrain.damaged_reads import READ_ERRORS, read_checked
from map3d.ingest.terrain.raster_georeference import open_raster
from map3d.ingest.terrain.raster_groups import Bounds
from map3d.ingest.terrain.raster_roles import NO_HEIGHTS, RasterRole

COVERED: Final = 0.5
"""A raster is not used if better ones cover this share of it."""
UNDER: Final = 0.2
"""A raster is said to lie under others if these cover this share of it."""
_GRID: Final = 16
_MAX_COMPARED: Final = 64
"""Rasters of equal rank whose heights are compared."""
_SAMPLE_PX: Final = 128
_SAME_HEIGHTS_M: Final = 200.0
_ROUGHER: Final = 3.0
_NEARER: Final = 3.0

Place = Mapping[Path, Bounds]


@dataclass
class RasterChoice:
    """`dems`, `orthos`: what is used; `ranks`: of several at one place, the one of the lowest rank is on top."""

    dems: list[Path] = field(default_factory=list)
    orthos: list[Path] = field(default_factory=list)
    ranks: dict[Path, int] = field(default_factory=dict)
    findings: list[dict[str, Any]] = field(default_factory=list)


def choose_rasters(roles: Sequence[RasterRole], bounds: Place, scene_height_m: float | None) -> RasterChoice:
    """`bounds`: of each raster, in one plane; `scene_height_m`: near the lowest height of what the scene has, None if it has nothing."""
    choice = RasterChoice(ranks={role.path: role.rank for role in roles})
    unused, undecided = list[str](), list[str]()
    heights = [role for role in roles if role.gives == "heights"]
    colours = [role for role in roles if role.gives == "colours"]
    good = [role for role in heights if role.rank < NO_HEIGHTS]
    if good or colours:
        unused += [f"{role.path.name}: {role.kind}; --elevation {role.path.name} reads it as heights" for role in heights if role not in good]
    else:
        example = f"{heights[0].path.name}: {heights[0].kind}; read as heights, since no other raster gives any" if heights else ""
        choice.findings += [finding("raster-role-unclear", len(heights), example)] if heights else []
        good = heights
    kept = _without_covered(good, bounds, unused, "--elevation")
    kept = _without_contradicting(kept, bounds, unused, undecided, scene_height_m)
    choice.dems = [role.path for role in kept]
    choice.orthos = [role.path for role in _without_covered(colours, bounds, unused, "")]
    used = set(choice.orthos)
    unclear = [role.path.name for role in colours if role.is_unclear and role.path in used]
    undecided += [f"{name}: 8 bits, read as a picture; --elevation {name} reads it as heights" for name in unclear]
    if undecided:
        choice.findings.append(finding("raster-role-unclear", len(undecided), undecided[0]))
    if unused:
        choice.findings.append(finding("raster-not-used", len(unused), unused[0]))
    return choice


def covered_share(box: Bounds, others: NDArray[np.float64]) -> float:
    """Returns the share of a box that others (n, 4) cover together."""
    if not len(others) or not np.isfinite(box).all():
        return 0.0
    at = (np.arange(_GRID) + 0.5) / _GRID
    x, y = np.meshgrid(box[0] + at * (box[2] - box[0]), box[1] + at * (box[3] - box[1]))
    inside = np.zeros(x.shape, dtype=bool)
    near = others[(others[:, 0] < box[2]) & (others[:, 2] > box[0]) & (others[:, 1] < box[3]) & (others[:, 3] > box[1])]
    for west, south, east, north in near:
        inside |= (x >= west) & (x <= east) & (y >= south) & (y <= north)
    return float(inside.mean())


def _boxes(roles: Iterable[RasterRole], bounds: Place) -> NDArray[np.float64]:
    return np.array([bounds[role.path] for role in roles], dtype=np.float64).reshape(-1, 4)


def _without_covered(roles: Sequence[RasterRole], bounds: Place, unused: list[str], option: str) -> list[RasterRole]:
    """Leaves out rasters that better ones cover, and says why."""
    kept = []
    for role in roles:
        better = [other for other in roles if other.rank < role.rank]
        if covered_share(bounds[role.path], _boxes(better, bounds)) < COVERED:
            kept.append(role)
            continue
        advice = f"; {option} {role.path.name} uses it instead" if option else ""
        best = min(better, key=lambda other: (other.rank, str(other.path)))
        unused.append(f"{role.path.name}: {role.kind}; {best.path.name} is {best.kind}{advice}")
    return kept


@dataclass(frozen=True)
class _Surface:
    """What the heights of a raster are like. `roughness`: the greater steps between neighbours, as a share of the range."""

    role: RasterRole
    heights: NDArray[np.float64]
    median: float
    roughness: float


def _without_contradicting(
    roles: Sequence[RasterRole], bounds: Place, unused: list[str], undecided: list[str], scene_height_m: float | None
) -> list[RasterRole]:
    """Leaves out rasters whose heights cannot be those of another one at the same place: the one near the scene's heights stays, or the smoother."""
    boxes = _boxes(roles, bounds)
    several = [role for k, role in enumerate(roles) if covered_share(bounds[role.path], np.delete(boxes, k, axis=0)) >= COVERED]
    if not 2 <= len(several) <= _MAX_COMPARED:
        return list(roles)
    dropped: set[Path] = set()
    surfaces = [surface for role in several if (surface := _surface(role)) is not None]
    for k, one in enumerate(surfaces):
        for other in surfaces[k + 1 :]:
            if dropped & {one.role.path, other.role.path} or not _contradict(one, other, bounds):
                continue
            worse, better, why = _decide(one, other, scene_height_m)
            dropped.add(worse.role.path)
            name, said = worse.role.path.name, f"other heights than {better.role.path.name} at the same place"
            (unused if why else undecided).append(f"{name}: {said}, {why or 'not used'}; --elevation {name} uses it instead")
    return [role for role in roles if role.path not in dropped]


def _surface(role: RasterRole) -> _Surface | None:
    try:
        with open_raster(role.path) as raster:
            rows, columns = min(raster.height, _SAMPLE_PX), min(raster.width, _SAMPLE_PX)
            data = read_checked(raster, 1, out_shape=(rows, columns), masked=True).astype(np.float64).filled(np.nan)
    except READ_ERRORS:
        return None  # what cannot be read is found, and named, when the terrain is built
    known = data[np.isfinite(data)]
    steps = np.abs(np.diff(data, axis=0)).ravel()
    steps = steps[np.isfinite(steps)]
    if len(known) < 16 or not len(steps):
        return None
    low, high = np.percentile(known, [2, 98])
    return _Surface(role, data, float(np.median(known)), float(np.percentile(steps, 99)) / max(high - low, 1e-9))


def _contradict(one: _Surface, other: _Surface, bounds: Place) -> bool:
    """Whether two rasters of the same place have nothing in common: heights far apart, or of another course."""
    if covered_share(bounds[one.role.path], _boxes([other.role], bounds)) < COVERED:
        return False
    if one.heights.shape != other.heights.shape:
        return abs(one.median - other.median) > _SAME_HEIGHTS_M
    both = np.isfinite(one.heights) & np.isfinite(other.heights)
    a, b = one.heights[both], other.heights[both]
    if len(a) < 16:
        return False
    if abs(float(np.median(a - b))) > _SAME_HEIGHTS_M:
        return True
    spread = float(np.std(a - b))
    return spread > 20.0 and spread > 0.7 * max(float(np.std(a)), float(np.std(b)))


def _decide(one: _Surface, other: _Surface, scene_height_m: float | None) -> tuple[_Surface, _Surface, str]:
    """Returns the raster that is left out, the one that stays, and why; no reason where only the names decide."""
    if scene_height_m is not None:
        far, near = sorted((one, other), key=lambda surface: -abs(surface.median - scene_height_m))
        if abs(far.median - scene_height_m) > _NEARER * max(abs(near.median - scene_height_m), _SAME_HEIGHTS_M / 2):
            return far, near, "far from those of the scene"
    rough, smooth = sorted((one, other), key=lambda surface: -surface.roughness)
    if rough.roughness > _ROUGHER * smooth.roughness:
        return rough, smooth, "and rougher"
    first, second = sorted((one, other), key=lambda surface: str(surface.role.path))
    return second, first, ""
