"""Compares the bases of objects with the ground below them, and decides how their heights are read (docs/odd-files.md, Height)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from map3d.coherence.ground import STANDING, Ground
from map3d.coherence.height_units import FOOT_M, is_guessed
from map3d.coherence.surveyed_assets import Flags, Floats, SurveyedAsset
from map3d.geometry.geoid import ACCURACY_M
from map3d.ingest.findings import finding
from map3d.requests.heights import HeightRule

FLAT: Final = ("road", "railway", "track", "square", "transportation_complex", "waterway", "land_use", "plant_cover", "water_body")
"""Classes whose objects may have no heights: their standards have them at 0 in coarse levels of detail."""
FOLLOWING: Final = ("solitary_vegetation_object", "city_furniture")

TOLERANCE_M: Final = 10.0
DEVIATIONS: Final = 4.0
"""Objects contradict the ground if the median of their distances from it exceeds both."""
STRAY_M: Final = 30.0
STRAY_WITHOUT_TERRAIN_M: Final = 100.0
STRAY_DEVIATIONS: Final = 8.0
LEAST_STANDING: Final = 8
"""Least number of objects of a class among which single ones stray."""
AT_ZERO_M: Final = 0.01
DRAPED_M: Final = 0.5
DRAPED_WITHOUT_TERRAIN_M: Final = 2.0
FLAT_M: Final = 1.0
"""Objects that rise no more than this are draped, others are set on the ground as they are."""
FAR_M: Final = 500.0
FAR_SIZES: Final = 16.0
"""Objects longer than both, the second in usual ones, are not compared: a corner of them is a stray."""
LEAST_GEOID_M: Final = 18.0
FEET_SHARE: Final = 0.02


@dataclass(frozen=True)
class Contradiction:
    """Objects of one class of an asset that are not on the ground. `kind`: the code of its message; `metres`: from the ground to their bases."""

    kind: str
    metres: float
    chosen: Flags


@dataclass
class HeightDecision:
    """How an asset is drawn: heights are multiplied by `scale`, and wholes moved by `shifts`. Those with a base in `draped`, which is NaN for the
    others, are draped over the ground with that height on it."""

    shifts: Floats
    draped: Floats
    scale: float = 1.0
    findings: list[dict[str, Any]] = field(default_factory=list)

    @property
    def is_plain(self) -> bool:
        return self.scale == 1.0 and not self.shifts.any() and not np.isfinite(self.draped).any()


def decide_heights(
    assets: Sequence[SurveyedAsset], kept: Mapping[str, Flags], ground: Ground, rule: HeightRule, geoid_m: float | None
) -> dict[str, HeightDecision]:
    """Returns a decision for each document. `kept`: asset → (wholes,) whether a whole is drawn; `geoid_m`: above the ellipsoid, None if unknown."""
    documents = [_Document(asset, kept[asset.name], ground, geoid_m) for asset in assets if not asset.is_raster]
    for document in documents:
        document.judge()
    are_meant = any(document.contradicts for document in documents)
    for document in documents:
        document.decide(rule, is_meant=document.contradicts or not are_meant)
    _unite(documents)
    return {document.asset.name: document.finish() for document in documents}


class _Document:
    """The heights of one document beside the ground."""

    def __init__(self, asset: SurveyedAsset, kept: Flags, ground: Ground, geoid_m: float | None) -> None:
        self.asset, self._ground, self._geoid_m = asset, ground, geoid_m
        self._kept = kept & asset.drawn & ~asset.is_terrain
        self._sound = self._kept & ~_reach_far(asset, self._kept)
        self._low, self._high = asset.boxes[:, 0, 2], asset.boxes[:, 1, 2]
        self._terrain, self._below = ground.terrain[asset.name], ground.below(asset.name)
        self.decision = HeightDecision(np.zeros(len(self._low)), np.full(len(self._low), np.nan))
        self._is_guessed = is_guessed(asset.record.report)
        self.found: list[Contradiction] = []
        self.strays: list[Contradiction] = []

    @property
    def contradicts(self) -> bool:
        return bool(self.found or self.strays)

    def judge(self) -> None:
        """Finds what contradicts the ground, with heights as decided so far."""
        bases = self._low * self.decision.scale + self.decision.shifts
        flat = self._without_heights()
        judged = self._sound & ~flat & ~np.isfinite(self.decision.draped)
        self.found = [found for chosen in self._groups(judged) if (found := self._contradiction(bases, chosen)) is not None]
        taken = np.any([found.chosen for found in self.found], axis=0) if self.found else np.zeros(len(bases), dtype=bool)
        self.strays = list(self._strays(bases, judged & ~taken))

    def decide(self, rule: HeightRule, *, is_meant: bool) -> None:
        """`is_meant`: what the rule says of heights is meant for this document."""
        if rule.heights != "as-is":
            self._drape(self._without_heights(), "flat-objects-draped")
        if rule.is_by_evidence and self._is_guessed and self.found and all(found.kind == "heights-in-metres" for found in self.found):
            self.decision.scale = 1 / FOOT_M
            self._note("heights-read-in-metres", self._kept)
        elif rule.offset_m is not None and is_meant:
            self.decision.shifts += rule.offset_m
            self._note("heights-moved", self._kept, metres=rule.offset_m)
        clamped = np.isin(self.asset.classes, rule.clamp)
        if rule.heights == "clamp" and is_meant:
            contradicting = [found.chosen for found in (*self.found, *self.strays)]
            clamped |= np.any(contradicting, axis=0) if contradicting else np.isin(self.asset.classes, (*STANDING, *FLAT, *FOLLOWING))
        self._clamp(clamped & self._kept & ~np.isfinite(self.decision.draped), follow=rule.heights == "clamp" and bool(self.found))
        self.found, self.strays = [], []
        if rule.heights != "as-is":
            self.judge()

    def finish(self) -> HeightDecision:
        for found in (*self.found, *self.strays):
            self.decision.findings.append(self._finding(found))
        return self.decision

    def _groups(self, judged: Flags) -> Iterator[Flags]:
        for name in (*STANDING, *FLAT, *FOLLOWING):
            chosen = judged & (self.asset.classes == name)
            if chosen.any():
                yield chosen

    def _contradiction(self, bases: Floats, chosen: Flags) -> Contradiction | None:
        chosen = chosen & np.isfinite(self._terrain)
        if not chosen.any():
            return None
        base, terrain = bases[chosen], self._terrain[chosen]
        metres, deviation = _robust(base - terrain)
        if abs(metres) <= max(TOLERANCE_M, DEVIATIONS * deviation):
            return None
        return Contradiction(self._kind(base, terrain, metres, deviation), metres, chosen)

    def _kind(self, base: Floats, terrain: Floats, metres: float, deviation: float) -> str:
        """Returns what would explain the distance of bases from the terrain: constant ones heights of another kind, others another unit."""
        if np.quantile(np.abs(base), 0.95) <= AT_ZERO_M:
            return "heights-at-zero"
        by_geoid = self._kind_by_geoid(metres) if deviation <= TOLERANCE_M / 2 else None
        by_unit = self._kind_by_unit(base, terrain, deviation)
        found = (by_unit or by_geoid) if self._is_guessed else (by_geoid or by_unit)
        return found or ("heights-below-terrain" if metres < 0 else "heights-above-terrain")

    def _kind_by_unit(self, base: Floats, terrain: Floats, deviation: float) -> str | None:
        own = ("heights-in-metres", base / FOOT_M - terrain) if self._is_guessed else ("heights-in-feet", base * FOOT_M - terrain)
        for kind, fitted in (own, ("terrain-in-feet", base - terrain * FOOT_M)):
            middle, spread = _robust(fitted)
            if abs(middle) <= max(TOLERANCE_M / 2, FEET_SHARE * float(np.median(np.abs(terrain)))) and spread <= max(deviation, TOLERANCE_M / 2):
                return kind
        return None

    def _kind_by_geoid(self, metres: float) -> str | None:
        if self._geoid_m is None or abs(self._geoid_m) < LEAST_GEOID_M:
            return None
        both = (("heights-ellipsoidal", metres - self._geoid_m), ("terrain-ellipsoidal", metres + self._geoid_m))
        return next((kind for kind, away in both if abs(away) <= ACCURACY_M), None)

    def _strays(self, bases: Floats, judged: Flags) -> Iterator[Contradiction]:
        """Finds single objects that stand far above or below the ground on which the others of their class stand."""
        for name in STANDING:
            chosen = judged & (self.asset.classes == name) & np.isfinite(self._below)
            if chosen.sum() < LEAST_STANDING:
                continue
            away = bases - self._below
            middle, deviation = _robust(away[chosen])
            least_m = np.where(np.isfinite(self._terrain), STRAY_M, STRAY_WITHOUT_TERRAIN_M)
            strays = chosen & (np.abs(away - middle) > np.maximum(least_m, STRAY_DEVIATIONS * deviation))
            if strays.any():
                yield Contradiction("objects-off-ground", float(max(away[strays], key=abs)), strays)

    def _without_heights(self) -> Flags:
        """Returns (wholes,) those that lie at height 0 where the ground is not, as objects of their class do in coarse levels of detail."""
        is_zero = self._kept & (self._low == 0.0) & (self._high == 0.0)
        may_be = np.isin(self.asset.classes, FLAT) | (self.asset.lods == 0.0)
        least_m = np.where(np.isfinite(self._terrain), DRAPED_M, DRAPED_WITHOUT_TERRAIN_M)
        least_m = np.where(self.asset.classes == "water_body", TOLERANCE_M, least_m)
        zero: Flags = is_zero & may_be
        for name in np.unique(self.asset.classes[zero]):
            own = zero & (self.asset.classes == name)
            zero &= ~own | bool((np.abs(np.nan_to_num(self._below[own])) > least_m[own]).any())
        return zero

    def _drape(self, chosen: Flags, code: str) -> None:
        chosen = chosen & ~self.asset.placed
        self.decision.draped[chosen] = self._low[chosen]
        for name in np.unique(self.asset.classes[chosen]):
            own = chosen & (self.asset.classes == name)
            self._note(code, own, **{"class": str(name)})

    def _clamp(self, chosen: Flags, *, follow: bool) -> None:
        """Sets objects on the ground: flat ones are draped, others are moved. `follow`: what stands on no ground moves like most of them."""
        chosen = chosen & np.isfinite(self._below)
        is_flat = np.isin(self.asset.classes, FLAT) & (self._high - self._low <= FLAT_M) & ~self.asset.placed
        self._drape(chosen & is_flat, "objects-draped")
        moved = chosen & ~is_flat
        if not moved.any():
            return
        self.decision.shifts[moved] = self._below[moved] - self._low[moved] * self.decision.scale
        self._note("objects-clamped", moved)
        rest = self._kept & ~moved & ~np.isin(self.asset.classes, (*STANDING, *FLAT, *FOLLOWING))
        if follow:
            self.decision.shifts[rest] = float(np.median(self.decision.shifts[moved]))

    def _note(self, code: str, chosen: Flags, **values: Any) -> None:
        if chosen.any():
            self.decision.findings.append(finding(code, int(chosen.sum()), self._example(chosen), **values))

    def _finding(self, found: Contradiction) -> dict[str, Any]:
        values = {"class": str(self.asset.classes[found.chosen][0]), "distance": abs(round(found.metres, 1)), "offset": f"{-found.metres:+.1f}"}
        return finding(found.kind, int(found.chosen.sum()), self._example(found.chosen), **values)

    def _example(self, chosen: Flags) -> str:
        """Returns the name of the object that is farthest from the ground, with both heights."""
        away = np.where(chosen, np.nan_to_num(np.abs(self._low - self._below)), -1.0)
        number = int(np.argmax(away))
        name = self.asset.names_of(np.array([number]), 1)[0]
        heights = f"{name}: {self._low[number]:.1f} m"
        return heights if np.isnan(self._below[number]) else f"{heights}, ground {self._below[number]:.1f} m"


def _unite(documents: Sequence[_Document]) -> None:
    """Gives contradictions of one kind and class that are about as large in several files the same distance, so that they are said once."""
    together: dict[tuple[str, str], list[tuple[_Document, int]]] = {}
    for document in documents:
        for number, found in enumerate(document.found):
            together.setdefault((found.kind, str(document.asset.classes[found.chosen][0])), []).append((document, number))
    for places in together.values():
        middle = float(np.median([document.found[number].metres for document, number in places]))
        for document, number in places:
            found = document.found[number]
            if abs(found.metres - middle) <= max(TOLERANCE_M / 2, 0.05 * abs(middle)):
                document.found[number] = Contradiction(found.kind, middle, found.chosen)


def _reach_far(asset: SurveyedAsset, kept: Flags) -> Flags:
    """Returns (wholes,) those that a stray corner makes much larger than the others: their lowest point is no base."""
    sizes = np.where(kept, (asset.boxes[:, 1, :2] - asset.boxes[:, 0, :2]).max(axis=1), 0.0) if kept.any() else np.zeros(len(kept))
    usual_m = float(np.median(sizes[kept])) if kept.any() else 0.0
    found: Flags = sizes > max(FAR_M, FAR_SIZES * usual_m)
    return found


def _robust(values: Floats) -> tuple[float, float]:
    """Returns the median, and the deviation from it that a normal distribution would have."""
    middle = float(np.median(values))
    return middle, 1.4826 * float(np.median(np.abs(values - middle)))
