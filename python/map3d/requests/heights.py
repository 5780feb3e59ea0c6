"""What a request asks of heights that contradict the ground."""

from dataclasses import dataclass
from typing import Final

from map3d.errors import BadRequest
from map3d.requests.param import param

BY_EVIDENCE: Final = "auto"
HEIGHTS: Final = (BY_EVIDENCE, "as-is", "clamp")
MAX_OFFSET_M: Final = 100_000.0


@dataclass(frozen=True, kw_only=True)
class HeightChoice:
    """How objects get to the ground where the heights of the files contradict each other."""

    heights: str | None = param(
        None,
        help="Heights of files that contradict the terrain or each other: as-is leaves them, clamp sets their objects on it, a number of metres "
        "moves them, and auto sets only objects on it that have no heights by their standard.",
        words="as before, first auto",
        metavar="auto|as-is|clamp|METRES",
        label="Heights of files that contradict the terrain or each other",
    )
    clamp: tuple[str, ...] = param(
        (),
        help="Classes of objects to set on the ground, such as building or road, or none.",
        words="as before, first none",
        label="Classes of objects to set on the ground",
    )


@dataclass(frozen=True)
class HeightRule:
    """`heights`: a word of HEIGHTS; `offset_m`: moves in place of that; `clamp`: classes that are set on the ground."""

    heights: str = BY_EVIDENCE
    offset_m: float | None = None
    clamp: tuple[str, ...] = ()

    @property
    def is_by_evidence(self) -> bool:
        return self.heights == BY_EVIDENCE and self.offset_m is None


def parse_heights(heights: str | None, clamp: tuple[str, ...] = ()) -> HeightRule:
    """Raises BadRequest for anything but a word of HEIGHTS and a number of metres. None decides by evidence."""
    if heights is None or heights in HEIGHTS:
        return HeightRule(heights or BY_EVIDENCE, clamp=clamp)
    try:
        offset_m = float(heights)
    except ValueError:
        offset_m = MAX_OFFSET_M * 2
    if not abs(offset_m) <= MAX_OFFSET_M:
        raise BadRequest(f"--heights {heights}: write {', '.join(HEIGHTS)}, or metres such as -46.5")
    return HeightRule(offset_m=offset_m, clamp=clamp)
