"""Transforms the parts of one document to the scene's CRS, each from the CRS that the nearest element above it names."""

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from map3d.catalogue import SceneCrs
from map3d.errors import CrsError
from map3d.geometry.crs import horizontal_crs, parse_crs, vertical_crs_name
from map3d.ingest.asset_reprojector import AssetReprojector
from map3d.ingest.crs_transformer import Points
from map3d.ingest.evidence import Evidence
from map3d.ingest.findings import finding, findings
from map3d.requests.reading import Axes

_MAX_NAME: Final = 80

Transforms = NDArray[np.float64]
"""(m, 12)."""


_Transform = Callable[[AssetReprojector, Points], Points]


class DocumentReprojector:
    """Transforms parts by the name of their CRS. Names that mean the same share one `AssetReprojector`; the first part determines the CRS of a
    scene without one.

    A part in a CRS that is not usable is skipped and counted, unless it is the document's own, which raises CrsError.
    """

    def __init__(
        self,
        format: str,
        document_crs: str | None,
        scene_crs: str | None,
        *,
        stated: str | None = None,
        strict: bool = False,
        evidence: Evidence | None = None,
    ) -> None:
        """`document_crs`: the name in the file, or None; `stated`: the user's, which counts for all parts; `scene_crs`: WKT, "local",
        or None while the scene has no CRS; `strict`: the first part that would be skipped raises CrsError; `evidence`: what else is known of the
        document."""
        self._evidence = evidence
        self._format, self._scene_crs, self._stated, self._strict = format, scene_crs, stated, strict
        self._document_crs = stated or document_crs
        self._names: dict[str | None, str | None] = {}
        self._reprojectors: dict[str | None, AssetReprojector] = {}
        self._errors: dict[str | None, CrsError] = {}
        self._used: dict[str | None, int] = {}
        self._skipped: dict[str | None, int] = {}

    def to_world(self, points: Points, name: str | None, parts: int) -> Points | None:
        """Returns (n, 3) world coordinates; None if the `parts` (triangles) that have them are skipped. Raises CrsError for the document's CRS."""
        return self._apply(name, parts, AssetReprojector.to_world, points)

    def transforms_to_world(self, transforms: Transforms, names: list[str | None], numbers: NDArray[np.uint16]) -> Transforms:
        """Converts prototype-to-source transforms to prototype-to-world; not finite where skipped. `numbers`: (m,) indices into `names`."""
        out = np.full_like(transforms, np.nan)
        for number in np.unique(numbers).tolist():
            chosen = numbers == number
            own = transforms[chosen]
            world = self._apply(names[number], len(own), AssetReprojector.transforms_to_world, own)
            if world is not None:
                out[chosen] = world
        return out

    @property
    def proposed_crs(self) -> SceneCrs | None:
        """The CRS for a scene that has none; None before any position was transformed."""
        first = self._first
        return None if first is None else first.proposed_crs

    def axes(self, name: str | None) -> Axes:
        """Returns the order of axes of the parts in a CRS that the document names; "auto" if no part told it."""
        known = self._reprojectors.get(self._names.get(name))
        return "auto" if known is None else known.axes

    def report(self, counts: Mapping[str, Any]) -> dict[str, Any]:
        """Returns the core's report with what is skipped, odd or worth knowing about coordinates. Raises CrsError if all parts are skipped, and for
        something odd under `strict`."""
        if self._errors and not self._used:
            raise next(iter(self._errors.values()))
        odd = [item for reprojector in self._reprojectors.values() for item in reprojector.findings]
        if odd and self._strict:
            raise CrsError(str(findings({"findings": odd})[0]))
        skipped = [finding("part-crs-unusable", count, str(self._errors[name]), name=_short(name)) for name, count in self._skipped.items()]
        first = self._first or self._reprojector(self._document_crs)
        named = next(iter(self._used), None)
        return {
            **counts,
            **({} if self._stated or named is None else {"crs": named}),
            "findings": [*counts.get("findings", []), *skipped, *odd, *self._notes()],
            "placing": first.report,
        }

    @property
    def _first(self) -> AssetReprojector | None:
        """The reprojector of the first part."""
        return next((self._reprojectors[name] for name in self._used), None)

    def _apply(self, name: str | None, parts: int, transform: _Transform, values: Points) -> Points | None:
        key = self._key(name)
        error = self._errors.get(key)
        if error is None:
            try:
                world = transform(self._reprojector(key), values)
                self._used[key] = self._used.get(key, 0) + parts
                return world
            except CrsError as raised:
                error = raised
        if key == self._document_crs or self._strict:
            raise error
        self._errors[key] = error
        self._skipped[key] = self._skipped.get(key, 0) + parts
        return None

    def _key(self, name: str | None) -> str | None:
        """Returns the name under which parts of this CRS are transformed."""
        if name not in self._names:
            known = (other for other in (self._document_crs, *self._reprojectors) if _means(name, other))
            self._names[name] = self._document_crs if self._stated else next(known, name)
        return self._names[name]

    def _reprojector(self, key: str | None) -> AssetReprojector:
        if key not in self._reprojectors:
            first = self._first
            proposed = None if first is None else first.proposed_crs
            scene = self._scene_crs or (None if proposed is None else proposed.wkt or "local")
            self._reprojectors[key] = AssetReprojector(self._format, key, scene, stated=self._stated is not None, evidence=self._evidence)
        return self._reprojectors[key]

    def _notes(self) -> list[dict[str, Any]]:
        first = self._first
        return [*([] if first is None else first.notes), *self._notes_of_parts()]

    def _notes_of_parts(self) -> list[dict[str, Any]]:
        if self._stated:
            distinct: list[str] = []
            for name in self._names:
                if name is not None and not any(_means(name, other) or _means(other, name) for other in distinct):
                    distinct.append(name)
            example = f"{', '.join(map(_short, distinct))}; read as {self._stated}"
            return [finding("several-crs-overridden", len(distinct), example)] if len(distinct) > 1 else []
        others = list(self._used)[1:]
        return [finding("parts-in-other-crs", self._used[name], f"{_short(name)}: {_describe(self._reprojectors[name])}") for name in others]


def _means(name: str | None, other: str | None) -> bool:
    """Whether coordinates in the CRS `name` can be read as ones in `other`: the horizontal parts are equal, and the heights if `name` has any."""
    if name == other or name is None or other is None:
        return name == other
    try:
        a, b = parse_crs(name), parse_crs(other)
    except CrsError:
        return False
    if not horizontal_crs(a).equals(horizontal_crs(b), ignore_axis_order=not horizontal_crs(a).is_geographic):
        return False
    heights = vertical_crs_name(a)
    return heights is None or heights == vertical_crs_name(b)


def _describe(reprojector: AssetReprojector) -> str:
    report = reprojector.report
    accuracy = report.get("accuracy_m")
    exact = "accuracy unknown" if accuracy is None or report.get("ballpark") else f"accurate to {accuracy:g} m"
    heights = f"; heights {report['heights']}" if "heights" in report else ""
    return f"from {report['from']} to {report['to']}, {exact}{reprojector.better}{heights}"


def _short(name: str | None) -> str:
    return "(none)" if name is None else name if len(name) <= _MAX_NAME else name[:_MAX_NAME] + "…"
