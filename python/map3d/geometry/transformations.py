"""Chooses how positions get from one CRS to another: by what PROJ knows and has grids for, by way of WGS 84, or not at all."""

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.transformer import TransformerGroup

from map3d.errors import CrsError
from map3d.geometry.crs import horizontal_crs

Array = NDArray[np.float64]
LonLat = tuple[float, float]
"""Degrees, WGS 84."""

_HUB: Final = "EPSG:4326"
_UNNAMED: Final = re.compile(r"unknown|unnamed|not specified|user defined|^based on", re.IGNORECASE)
_BALLPARK: Final = "ballpark"


@dataclass(frozen=True)
class Transformation:
    """Transforms x and y, east first; usable in several threads. `steps`: none within one CRS. `accuracy_m`: None if unknown. `inexact`: the datum of
    one of the two has no name, so that its coordinates are taken for those of the other. `better`: a more accurate operation that PROJ knows and
    lacks grids for, and `grids`: their files."""

    steps: tuple[Transformer, ...]
    description: str
    accuracy_m: float | None
    inexact: bool = False
    better: str | None = None
    grids: tuple[str, ...] = ()

    @property
    def report(self) -> dict[str, Any]:
        """Returns what import reports say of it."""
        found = {"operation": self.description, "accuracy_m": self.accuracy_m, "ballpark": self.inexact}
        return found | ({} if self.better is None else {"better_but_not_installed": self.better, "missing_grids": list(self.grids)})

    def __call__(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Returns x and y in the target CRS, infinite where it does not reach."""
        for step in self.steps:
            x, y = step.transform(x, y)
        return np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)


@lru_cache(maxsize=256)
def find_transformation(source: CRS, target: CRS, place: LonLat | None = None) -> Transformation:
    """Returns the transformation between the horizontal parts of two CRSs, the best one at a place if that is known.

    A ballpark transformation, which takes coordinates of one datum for those of another, is used only if one of the two datums has no name. Raises
    CrsError if there is no other, with the grids that are missing.
    """
    own, wanted = horizontal_crs(source), horizontal_crs(target)
    if own.equals(wanted, ignore_axis_order=True):
        return Transformation((), "none: same CRS", 0.0)
    direct = _operations(own, wanted)
    best = _best(direct, place)
    if best is not None:
        return _described((best,), [direct], place)
    bound = _bound_part(source)
    for start in [own] if bound is None else [bound, own]:
        groups = [_operations(start, CRS(_HUB)), _operations(CRS(_HUB), wanted)]
        steps = [_best(group, place) for group in groups]
        if all(step is not None for step in steps):
            return _described([step for step in steps if step is not None], [*groups, direct], place)
    unnamed = _is_unnamed(own) or _is_unnamed(wanted)
    if unnamed or (_is_geocentric(own) and _is_geocentric(wanted)):
        with_ballpark = _operations(own, wanted, allow_ballpark=True)
        if with_ballpark.transformers:
            return replace(_described(with_ballpark.transformers[:1], [], place), accuracy_m=None, inexact=unnamed)
    raise CrsError(_refusal(own, wanted, _missing_grids([direct, _operations(own, CRS(_HUB))])))


@dataclass(frozen=True)
class _Operations:
    """`transformers`: installed, the most relevant first; `unavailable`: operations of pyproj that lack a grid."""

    transformers: Sequence[Transformer] = ()
    unavailable: Sequence[Any] = ()


@lru_cache(maxsize=64)
def _operations(source: CRS, target: CRS, *, allow_ballpark: bool = False) -> _Operations:
    """Suppresses the warning that a better operation is not installed: the import report contains it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        try:
            group = TransformerGroup(source, target, always_xy=True, allow_ballpark=allow_ballpark)
        except IndexError:  # pyproj looks for the grid of a missing operation that has none.
            return _Operations()
    return _Operations(group.transformers, group.unavailable_operations)


def _best(group: _Operations, place: LonLat | None) -> Transformer | None:
    """Returns the most accurate installed operation whose area has the place; where none has, the most accurate one."""
    here = (one for one in group.transformers if place is None or _reaches(one, place))
    return next(here, next(iter(group.transformers), None))


def _reaches(operation: Any, place: LonLat) -> bool:
    area = operation.area_of_use
    if area is None:
        return True
    width = (area.east - area.west) % 360.0 or 360.0
    return bool(area.south <= place[1] <= area.north and (place[0] - area.west) % 360.0 <= width)


def _described(steps: Sequence[Transformer], groups: Sequence[_Operations], place: LonLat | None) -> Transformation:
    accuracies = [step.accuracy for step in steps]
    known = all(accuracy is not None and accuracy >= 0.0 for accuracy in accuracies)
    total = sum(accuracies) if known else None
    # Transformers of a group are bound to the thread that made them.
    own = tuple(Transformer.from_pipeline(step.definition) for step in steps)
    found = Transformation(own, " + ".join(_words(step.description) for step in steps), total)
    unavailable = [one for group in groups for one in group.unavailable if place is None or _reaches(one, place)]
    better = next((one for one in unavailable if total is None or 0.0 <= one.accuracy < total), None)
    if better is None:
        return found
    return replace(found, better=_words(better.name), grids=tuple(grid.short_name for grid in better.grids if not grid.available))


def _words(description: str) -> str:
    """Leaves out the steps that only exchange axes."""
    parts = [part for part in description.split(" + ") if not part.startswith("axis order change")]
    return " + ".join(parts) or description


def _missing_grids(groups: Sequence[_Operations]) -> list[str]:
    names = (grid.short_name for group in groups for one in group.unavailable for grid in one.grids if not grid.available)
    return list(dict.fromkeys(names))


def _refusal(source: CRS, target: CRS, grids: Sequence[str]) -> str:
    if not grids:
        return f"no transformation from {source.name} to {target.name} is known; name another CRS with --crs"
    return (
        f"no transformation from {source.name} to {target.name} is possible without the grid {grids[0]}; "
        f"install it with projsync --file {grids[0]}, or set PROJ_DATA to a folder that has it"
    )


def _bound_part(crs: CRS) -> CRS | None:
    """Returns the horizontal part with the parameters of its datum that the file states (TOWGS84); None if it states none."""
    part = crs.sub_crs_list[0] if crs.is_compound else crs
    return part if part.is_bound else None


def _is_geocentric(crs: CRS) -> bool:
    """Whether the datum is a modern one, whose centre is that of the Earth within a metre or two: all that have an ellipsoid of their size are."""
    ellipsoid = crs.ellipsoid
    return ellipsoid is not None and abs(ellipsoid.semi_major_metre - 6_378_137.0) < 0.5 and abs(ellipsoid.inverse_flattening - 298.2572) < 1e-3


def _is_unnamed(crs: CRS) -> bool:
    geodetic = crs.geodetic_crs
    datum = None if geodetic is None else geodetic.datum
    return datum is None or _UNNAMED.search(datum.name) is not None
