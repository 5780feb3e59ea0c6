"""Compares where the documents of an import say that they lie, before the first of them is imported: a document that does not tell the order of its
axes follows the others, and those of the largest place come first, since the first one determines the CRS of the scene."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, cast

import numpy as np

from map3d.catalogue import SceneRecord
from map3d.errors import CrsError
from map3d.formats import find_format
from map3d.geometry.crs import parse_crs
from map3d.geometry.crs_names import is_short_name
from map3d.geometry.transformations import LonLat
from map3d.ingest.coordinate_check import AxisDecision, CoordinateCheck
from map3d.ingest.document_sample import DocumentSample, read_sample
from map3d.ingest.evidence import Evidence
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.scene_crs import scene_place
from map3d.ingest.sources import SourceDocument
from map3d.requests.reading import Axes

CELL_DEG: Final = 0.5
"""Places are compared in cells; those in the same cell or ones beside each other are one place."""

Cell = tuple[int, int]


@dataclass(frozen=True)
class ImportPlan:
    """`sources`: in the order of import. `axes`: name of a source that does not tell the order of its axes → that of the others."""

    sources: tuple[SourceDocument, ...]
    axes: Mapping[str, Axes]

    def options(self, source: SourceDocument, options: ImportOptions) -> ImportOptions:
        """Returns the options with which a source is imported."""
        axes = self.axes.get(source.name)
        return options if axes is None else replace(options, followed_axes=axes)


def plan_import(sources: Sequence[SourceDocument], options: ImportOptions, scene: SceneRecord) -> ImportPlan:
    """Reads a bounded number of bytes of each document. Documents in one place, and a single one, are imported in the given order."""
    if len(sources) < 2 and scene.crs is None:
        return ImportPlan(tuple(sources), {})
    decisions = {source.name: decision for source in sources if (decision := _decide(source, options)) is not None}
    known = _known_cells(decisions.values(), scene)
    axes = {name: followed for name, decision in decisions.items() if (followed := _followed(decision, known)) is not None}
    places = {name: decision.places[axes.get(name, decision.axes)] for name, decision in decisions.items()}
    return ImportPlan(tuple(sources if scene.crs is not None else _largest_place_first(sources, places)), axes)


def _decide(source: SourceDocument, options: ImportOptions) -> AxisDecision | None:
    """Returns None for a document whose place cannot be told from its first bytes: its import finds it."""
    if not find_format(source.format).has_crs or find_format(source.format).is_grouped:
        return None
    path = source.paths[0]
    decision = _decide_by(read_sample(path, head_only=True), options)
    if decision is None or decision.by == "file":
        return decision
    return _decide_by(read_sample(path), options)


def _decide_by(sample: DocumentSample, options: ImportOptions) -> AxisDecision | None:
    label = options.crs or next((ring.name for ring in sample.rings if ring.name is not None), None)
    rings = sample.rings_of(None if options.crs else label)
    if label is None or not rings or not is_short_name(label):
        return None
    try:
        check = CoordinateCheck(
            parse_crs(label), label, stated=options.crs is not None, evidence=Evidence(axes=cast(Axes, options.axes), sample=sample)
        )
    except CrsError:
        return None
    points = np.concatenate([ring.points for ring in rings])
    finite = points[np.isfinite(points).all(axis=1)]
    return check.decision(finite, np.median(finite[:, :2], axis=0)) if len(finite) else None


def _known_cells(decisions: Collection[AxisDecision], scene: SceneRecord) -> frozenset[Cell]:
    """Returns where the files lie that tell the order of their axes, and the content of the scene; without these, files that towns decide."""
    place = scene_place(scene, None)
    certain = {_cell((place.lon, place.lat))} if place is not None else set()
    for by in ("file", "town"):
        if not certain:
            certain = {_cell(at) for decision in decisions if decision.by == by and (at := decision.places[decision.axes]) is not None}
    return frozenset(cell for one in certain for cell in _around(one))


def _followed(decision: AxisDecision, known: Collection[Cell]) -> Axes | None:
    """Returns the only order in which an undecided file lies among the others."""
    if decision.by == "file":
        return None
    among: list[Axes] = [axes for axes, place in decision.places.items() if place is not None and _cell(place) in known]
    return among[0] if len(among) == 1 and (decision.by != "town" or among[0] != decision.axes) else None


def _largest_place_first(sources: Sequence[SourceDocument], places: Mapping[str, LonLat | None]) -> Sequence[SourceDocument]:
    """Returns the documents of the place with the most bytes, then the other documents, then the rest; each in the given order."""
    cells = {source.name: _cell(at) for source in sources if (at := places.get(source.name)) is not None}
    groups = list(_groups(set(cells.values())))
    if len(groups) < 2:
        return sources
    sizes = {source.name: _bytes(source.paths[0]) for source in sources if source.name in cells}
    largest = max(groups, key=lambda group: sum(size for name, size in sizes.items() if cells[name] in group))
    ranks = {source.name: 2 if source.name not in places else 0 if cells.get(source.name) in largest else 1 for source in sources}
    return sorted(sources, key=lambda source: ranks[source.name])


def _groups(cells: set[Cell]) -> Iterator[set[Cell]]:
    """Yields the cells that lie beside each other, those of the first in order first."""
    for start in sorted(cells):
        if start in cells:
            group, waiting = set[Cell](), [start]
            while waiting:
                cell = waiting.pop()
                if cell in cells:
                    cells.remove(cell)
                    group.add(cell)
                    waiting += _around(cell)
            yield group


def _cell(place: LonLat) -> Cell:
    return round(place[0] % 360.0 / CELL_DEG) % round(360.0 / CELL_DEG), round(place[1] / CELL_DEG)


def _around(cell: Cell) -> list[Cell]:
    wide = round(360.0 / CELL_DEG)
    return [((cell[0] + dx) % wide, cell[1] + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]


def _bytes(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
