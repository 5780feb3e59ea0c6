"""What is known of a document beside its coordinates, by which their order and unit are decided."""

from dataclasses import dataclass, field
from typing import Final

from map3d.ingest.document_sample import DocumentSample
from map3d.requests.reading import Axes, HeightUnit

HEIGHT_UNITS_M: Final = {"m": 1.0, "ft": 0.3048, "us-ft": 1200.0 / 3937.0}


@dataclass(frozen=True)
class Evidence:
    """`axes`, `height_unit`: the user's options; `followed_axes`: the order of axes of the other files of the scene, for a document that does not
    tell its own; `sample`: of the document."""

    axes: Axes = "auto"
    followed_axes: Axes = "auto"
    height_unit: HeightUnit = "auto"
    sample: DocumentSample = field(default_factory=DocumentSample)
