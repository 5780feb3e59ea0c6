"""Compares the bases of objects with the ground below them, and decides how their heights are read (docs/odd-files.md, Height)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from map3d.coherence.ground import STANDING, Ground, bases_of
from map3d.coherence.height_kinds import DEVIATIONS, GROUND_KINDS, TOLERANCE_M, GeoidHeight, find_kind, robust_middle
from map3d.coherence.height_rules import HeightRules
from map3d.coherence.height_units import FOOT_M, is_guessed
from map3d.coherence.neighbours import FileBases, FileDifference, compare_files
from map3d.coherence.surveyed_assets import Flags, Floats, SurveyedAsset
from map3d.ingest.findings import finding
from map3d.ingest.ground_grid import GroundGrid
from map3d.requests.heights import HeightRule

FLAT: Final = ("road", "railway", "track", "square", "transportation_complex", "waterway", "land_use", "plant_cover", "water_body")
"""Classes whose objects may have no heights: their standards have them at 0 in coarse levels of detail."""
FOLLOWING: Final = ("solitary_vegetation_object", "city_furniture")

COMPARED: Final = tuple(name for name in STANDING if name != "other_construction")
"""Classes that are compared between files: bridges and tunnels of a file of their own are not on the ground of houses."""
STRAY_M: Final = 30.0
STRAY_WITHOUT_TERRAIN_M: Final = 100.0
STRAY_DEVIATIONS: Final = 8.0
LEAST_STANDING: Final = 8
"""Least number of objects of a class among which single ones stray."""
DRAPED_M: Final = 0.5
DRAPED_WITHOUT_TERRAIN_M: Final = 2.0
FLAT_M: Final = 1.0
"""Objects that rise no more than this are draped, others are set on the ground as they are."""
FAR_M: Final = 500.0
FAR_SIZES: Final = 16.0
"""Objects longer than both, the second in usual ones, are not compared: a corner of them is a stray."""
BESIDE_FILE: Final[Mapping[str, str]] = {
    "heights-at-zero": "heights-at-zero-beside-file",
    "heights-in-feet": "heights-in-feet-beside-file",
    "heights-in-metres": "heights-in-metres-beside-file",
    "heights-ellipsoidal": "heights-ellipsoidal-beside-file",
}
"""The codes of kinds of contradictions with the file beside."""
IN_METRES: Final = ("heights-in-metres", BESIDE_FILE["heights-in-metres"])
UNLIKE_FILE: Final = "heights-unlike-file"


@dataclass(frozen=True)
class Contradiction:
    """Objects of one class of an asset that are not on the ground. `kind`: the code of its message; `metres`: from the ground to their bases; `file`:
    the name of the file whose objects show the ground, empty for terrain."""

    kind: str
    metres: float
    chosen: Flags
    file: str = ""


@dataclass
class HeightDecision:
    """How an asset is drawn: heights are multiplied by `scale`, and wholes moved by `shifts`. Those with a base in `draped`, which is NaN for the
    others, are draped over the ground with that height on it; those `off_ground` contradict it as they are drawn."""

    shifts: Floats
    draped: Floats
    off_ground: Flags
    scale: float = 1.0
    findings: list[dict[str, Any]] = field(default_factory=list)

    @property
    def is_plain(self) -> bool:
        return self.scale == 1.0 and not self.shifts.any() and not np.isfinite(self.draped).any()


def decide_heights(
    assets: Sequence[SurveyedAsset], kept: Mapping[str, Flags], ground: Ground, rules: HeightRules, geoid: GeoidHeight
) -> dict[str, HeightDecision]:
    """Returns a decision for each document. `kept`: asset → (wholes,) whether a whole is drawn."""
    documents = [_Document(asset, kept[asset.name], ground, geoid) for asset in assets if not asset.is_raster]
    _judge(documents, ground, geoid)
    for rule, names in rules.groups([document.asset.name for document in documents]):
        group = [document for document in documents if document.asset.name in names]
        are_meant = any(document.contradicts for document in group)
        for document in group:
            document.decide(rule, is_meant=document.contradicts or not are_meant)
    _judge(documents, ground, geoid)
    _unite(documents)
    return {document.asset.name: document.finish() for document in documents}


def settled_ground(assets: Sequence[SurveyedAsset], kept: Mapping[str, Flags], decisions: Mapping[str, HeightDecision], ground: Ground) -> Ground:
    """Returns the ground with that between the bases of objects as they are drawn, without those that contradict the ground."""
    if all(decision.is_plain and not decision.off_ground.any() for decision in decisions.values()):
        return ground
    return replace(ground, grid=GroundGrid.of_bases(standing_bases(assets, kept, decisions)) or ground.grid)


def standing_bases(assets: Sequence[SurveyedAsset], kept: Mapping[str, Flags], decisions: Mapping[str, HeightDecision]) -> Floats:
    """Returns (n, 3) the bases of objects as they are drawn, without those that contradict the ground."""
    found = [np.empty((0, 3))]
    for asset in assets:
        if asset.name in decisions:
            decision = decisions[asset.name]
            found.append(bases_of(asset, kept[asset.name] & ~decision.off_ground, asset.boxes[:, 0, 2] * decision.scale + decision.shifts))
    return np.concatenate(found)


def _judge(documents: Sequence["_Document"], ground: Ground, geoid: GeoidHeight) -> None:
    """Finds what contradicts the terrain, then what contradicts the files beside it, then single objects, with heights as decided so far."""
    for document in documents:
        document.judge()
    compared = [document for document in documents if not document.found]
    differences = compare_files([document.file_bases() for document in compared], geoid)
    for difference in differences:
        compared[difference.file].contradict(difference, compared[difference.beside].asset)
    moved = any(not document.decision.is_plain for document in documents)
    if differences or moved:
        decisions = {document.asset.name: document.settle() for document in documents}
        kept = {document.asset.name: document.kept for document in documents}
        settled = settled_ground([document.asset for document in documents], kept, decisions, ground)
        for document in documents:
            document.stand_on(settled)
    for document in documents:
        document.judge_strays()


class _Document:
    """The heights of one document beside the ground."""

    def __init__(self, asset: SurveyedAsset, kept: Flags, ground: Ground, geoid: GeoidHeight) -> None:
        self.asset, self.kept, self._geoid = asset, kept, geoid
        self._kept = kept & asset.drawn & ~asset.is_terrain
        self._sound = self._kept & ~_reach_far(asset, self._kept)
        self._low, self._high = asset.boxes[:, 0, 2], asset.boxes[:, 1, 2]
        self._terrain, self._below = ground.terrain[asset.name], ground.below(asset)
        nothing = np.zeros(len(self._low), dtype=bool)
        self.decision = HeightDecision(np.zeros(len(self._low)), np.full(len(self._low), np.nan), nothing)
        self._is_guessed = is_guessed(asset.record.report)
        self.found: list[Contradiction] = []
        self.strays: list[Contradiction] = []
        self._is_as_is = False

    @property
    def contradicts(self) -> bool:
        return bool(self.found or self.strays)

    def judge(self) -> None:
        """Finds what contradicts the terrain, with heights as decided so far."""
        self.strays = []
        judged = self._judged()
        self.found = [found for chosen in self._groups(judged) if (found := self._contradiction(self._bases, chosen)) is not None]

    def file_bases(self) -> FileBases:
        """Returns what is compared with the files beside this one."""
        chosen = self._compared()
        low, high = self.asset.boxes[chosen, 0, :2], self.asset.boxes[chosen, 1, :2]
        is_right = bool(np.isfinite(self._terrain[chosen]).sum() * 2 > chosen.sum())
        return FileBases(np.column_stack([(low + high) / 2, self._bases[chosen]]), np.hypot(*(high - low).T), is_right, self._is_guessed)

    def contradict(self, difference: FileDifference, beside: SurveyedAsset) -> None:
        """Takes what contradicts the file beside this one. Objects on terrain fit that."""
        kind = UNLIKE_FILE if difference.kind in GROUND_KINDS else BESIDE_FILE.get(difference.kind, UNLIKE_FILE)
        for chosen in self._groups(self._compared() & ~np.isfinite(self._terrain)):
            self.found.append(Contradiction(kind, difference.metres, chosen, self.asset.label_of(beside)))

    def stand_on(self, ground: Ground) -> None:
        """Takes other ground where there is no terrain."""
        self._below = ground.below(self.asset)

    def judge_strays(self) -> None:
        """Finds single objects that contradict the ground."""
        taken = np.any([found.chosen for found in self.found], axis=0) if self.found else np.zeros(len(self._low), dtype=bool)
        self.strays = list(self._strays(self._bases, self._judged() & ~taken))

    def decide(self, rule: HeightRule, *, is_meant: bool) -> None:
        """`is_meant`: what the rule says of heights is meant for this document."""
        self._is_as_is = rule.heights == "as-is"
        if rule.heights != "as-is":
            self._drape(self._without_heights(), "flat-objects-draped")
        if rule.is_by_evidence and self._is_guessed and self.found and all(found.kind in IN_METRES for found in self.found):
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

    def settle(self) -> HeightDecision:
        """Returns the decision so far, which knows what contradicts the ground."""
        contradicting = [found.chosen for found in (*self.found, *self.strays)]
        self.decision.off_ground = np.any(contradicting, axis=0) if contradicting else np.zeros(len(self._low), dtype=bool)
        return self.decision

    def finish(self) -> HeightDecision:
        """Returns the decision with what is said; nothing is said of heights that the user wants as they are."""
        for found in () if self._is_as_is else (*self.found, *self.strays):
            self.decision.findings.append(self._finding(found))
        return self.settle()

    @property
    def _bases(self) -> Floats:
        """(wholes,) as decided so far."""
        return self._low * self.decision.scale + self.decision.shifts

    def _judged(self) -> Flags:
        return self._sound & ~self._without_heights() & ~np.isfinite(self.decision.draped)

    def _compared(self) -> Flags:
        return self._judged() & np.isin(self.asset.classes, COMPARED)

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
        metres, deviation = robust_middle(base - terrain)
        if abs(metres) <= max(TOLERANCE_M, DEVIATIONS * deviation):
            return None
        return Contradiction(find_kind(base, terrain, is_guessed=self._is_guessed, geoid=self._geoid), metres, chosen)

    def _strays(self, bases: Floats, judged: Flags) -> Iterator[Contradiction]:
        """Finds single objects that stand far above or below the ground on which the others of their class stand."""
        for name in STANDING:
            chosen = judged & (self.asset.classes == name) & np.isfinite(self._below)
            if chosen.sum() < LEAST_STANDING:
                continue
            away = bases - self._below
            middle, deviation = robust_middle(away[chosen])
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
        values |= {"file": found.file} if found.file else {}
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
            together.setdefault((found.kind + found.file, str(document.asset.classes[found.chosen][0])), []).append((document, number))
    for places in together.values():
        middle = float(np.median([document.found[number].metres for document, number in places]))
        for document, number in places:
            found = document.found[number]
            if abs(found.metres - middle) <= max(TOLERANCE_M / 2, 0.05 * abs(middle)):
                document.found[number] = replace(found, metres=middle)


def _reach_far(asset: SurveyedAsset, kept: Flags) -> Flags:
    """Returns (wholes,) those that a stray corner makes much larger than the others: their lowest point is no base."""
    sizes = np.where(kept, (asset.boxes[:, 1, :2] - asset.boxes[:, 0, :2]).max(axis=1), 0.0) if kept.any() else np.zeros(len(kept))
    usual_m = float(np.median(sizes[kept])) if kept.any() else 0.0
    found: Flags = sizes > max(FAR_M, FAR_SIZES * usual_m)
    return found
