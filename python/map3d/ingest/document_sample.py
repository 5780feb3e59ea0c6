"""Samples the coordinates of a GML document from a bounded number of its bytes: rings by the name of their CRS, and what else the document says of
axes and units. It is evidence for decisions, not a reader: what it does not understand it passes over."""

import gzip
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from html import unescape
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

HEAD_BYTES: Final = 128 << 10
WINDOW_BYTES: Final = 64 << 10
WINDOWS: Final = 6
MAX_NAME: Final = 16_384

_GZIP: Final = b"\x1f\x8b"
_WIDE: Final = {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}

# Every pattern excludes what follows it, so that a hostile file costs no more than its length.
_TOKEN: Final = re.compile(
    rb"<(?:[\w.-]++:)?(?:"
    rb"LinearRing\b(?P<ring_tag>[^<>]*+)>(?P<ring>(?:[^<]++|<(?!/?(?:[\w.-]++:)?LinearRing\b))*+)(?=<)"
    rb"|(?P<height>measuredHeight|storeysAboveGround)\b(?P<height_tag>[^<>]*+)>(?P<value>[^<]*+)(?=<)"
    rb"|(?P<surface>RoofSurface|GroundSurface)\b[^<>]*+>"
    rb"|(?P<member>cityObjectMember|featureMember|member)\b[^<>]*+>"
    rb"|[\w.-]++(?P<stated>[^<>]*\b(?:srsName|srsDimension)\s*=[^<>]*+)>)"
    rb"|</(?:[\w.-]++:)?(?:(?P<end>cityObjectMember|featureMember|member)|(?P<surface_end>RoofSurface|GroundSurface))\s*>"
)
_ATTRIBUTE: Final = re.compile(rb"\b(srsName|srsDimension|axisLabels|uomLabels|uom)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_TAG: Final = re.compile(rb"<[^<>]*>")

Points = NDArray[np.float64]
"""(n, 3), in the document's order of axes."""


@dataclass(frozen=True)
class Ring:
    """`name`: of the CRS, None if the document names none; `member`: number of the city object; `surface`: "RoofSurface", "GroundSurface" or ""."""

    name: str | None
    member: int
    surface: str
    points: Points


@dataclass(frozen=True)
class HeightAttribute:
    """A height or a number of storeys of a city object. `unit`: the `uom`, empty if absent."""

    member: int
    name: str
    value: float
    unit: str


@dataclass
class DocumentSample:
    """`names`: of CRSs, in the order in which the document names them; `axis_labels`, `units`: by name; `whole`: the sample is the whole document."""

    names: list[str] = field(default_factory=list)
    axis_labels: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    rings: list[Ring] = field(default_factory=list)
    heights: list[HeightAttribute] = field(default_factory=list)
    whole: bool = True

    def rings_of(self, name: str | None) -> list[Ring]:
        """Returns the rings in a CRS; `name`: as the document writes it; None for all."""
        return [ring for ring in self.rings if name is None or ring.name == name]


def read_sample(path: Path, *, head_only: bool = False) -> DocumentSample:
    """Reads the head of a document, and unless `head_only` some windows spread over it; of a gzip file its head. A file that cannot be read, or is
    no such document, has an empty sample: the import says why."""
    sample = DocumentSample()
    try:
        pieces = list(_pieces(path, sample, head_only=head_only))
    except (OSError, EOFError, ValueError):
        return DocumentSample(whole=False)
    scan = _Scan(sample)
    for number, piece in enumerate(pieces):
        scan.read(piece, is_head=number == 0)
    return sample


def _pieces(path: Path, sample: DocumentSample, *, head_only: bool) -> Iterator[bytes]:
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES + 1)
        size = file.seek(0, 2)
        if head.startswith(_GZIP):
            with gzip.open(path) as unpacked:
                head, size = unpacked.read(HEAD_BYTES + 1), 0
        sample.whole = len(head) <= HEAD_BYTES
        wide = _WIDE.get(head[:2])
        if wide is not None:
            sample.whole = False
            yield head[: len(head) // 2 * 2].decode(wide, "ignore").encode()
            return
        yield head
        rest = size - HEAD_BYTES
        if head_only or rest <= 0:
            return
        count = min(WINDOWS, -(-rest // WINDOW_BYTES))
        for k in range(count):
            file.seek(HEAD_BYTES + rest * k // count)
            yield file.read(WINDOW_BYTES)


class _Scan:
    """Adds the pieces of a document to its sample. A CRS that a part names holds until the end of its city object."""

    def __init__(self, sample: DocumentSample) -> None:
        self._sample, self._member = sample, 0
        self._document: tuple[str | None, int] | None = None
        self._name: str | None = None
        self._dimension, self._surface = 3, ""

    def read(self, piece: bytes, *, is_head: bool) -> None:
        if not is_head:
            self._end_member()
        for token in _TOKEN.finditer(piece):
            found = token.groupdict()
            if found["ring"] is not None:
                self._add_ring(found["ring_tag"], found["ring"])
            elif found["member"] is not None:
                self._document = self._document or (self._name, self._dimension)
            elif found["end"] is not None:
                self._end_member()
            elif found["surface"] is not None:
                self._surface = found["surface"].decode()
            elif found["surface_end"] is not None:
                self._surface = ""
            elif found["height"] is not None:
                self._add_height(found)
            elif found["stated"] is not None:
                self._state(_attributes(found["stated"]))

    def _state(self, stated: Mapping[str, str]) -> None:
        name = stated.get("srsName", self._name)
        self._name, self._dimension = name, _dimension(stated, self._dimension)
        if name is None or "srsName" not in stated:
            return
        if name not in self._sample.names:
            self._sample.names.append(name)
        for attribute, known in (("axisLabels", self._sample.axis_labels), ("uomLabels", self._sample.units)):
            if stated.get(attribute):
                known.setdefault(name, stated[attribute])

    def _end_member(self) -> None:
        """What is stated before the first city object counts for all of them; without that, what the first one states."""
        self._member, self._surface = self._member + 1, ""
        name, self._dimension = self._document or (self._name, self._dimension)
        self._name = next(iter(self._sample.names), None) if name is None else name

    def _add_ring(self, tag: bytes, text: bytes) -> None:
        stated = _attributes(tag) | _attributes(text)
        if "srsName" in stated:
            self._state(stated)
        dimension = _dimension(stated, self._dimension)
        try:
            values = np.array(_TAG.sub(b" ", text).replace(b",", b" ").split(), dtype=np.float64)
        except ValueError:
            return
        if len(values) < 3 * dimension or len(values) % dimension:
            return
        points = values.reshape(-1, dimension)
        if dimension == 2:
            points = np.column_stack([points, np.zeros(len(points))])
        self._sample.rings.append(Ring(self._name, self._member, self._surface, points))

    def _add_height(self, found: Mapping[str, bytes]) -> None:
        try:
            value = float(found["value"])
        except ValueError:
            return
        unit = _attributes(found["height_tag"]).get("uom", "")
        self._sample.heights.append(HeightAttribute(self._member, found["height"].decode(), value, unit))


def _attributes(text: bytes) -> dict[str, str]:
    found = {name.decode(): unescape((one or other)[:MAX_NAME].decode("utf-8", "replace")) for name, one, other in _ATTRIBUTE.findall(text)}
    return {name: value.strip() for name, value in found.items()}


def _dimension(stated: Mapping[str, Any], known: int) -> int:
    return int(stated["srsDimension"]) if stated.get("srsDimension") in ("2", "3") else known
