"""Unions of boxes, and boxes of parents from their children."""

from collections.abc import Mapping

from map3d.types import Box


def unite_boxes(a: Box | None, b: Box | None) -> Box | None:
    """Returns the smallest box that contains both."""
    if a is None or b is None:
        return a or b
    low = tuple(min(pair) for pair in zip(a[0], b[0], strict=True))
    high = tuple(max(pair) for pair in zip(a[1], b[1], strict=True))
    return ((low[0], low[1], low[2]), (high[0], high[1], high[2]))


def include_children(boxes: Mapping[int, Box | None], parents: Mapping[int, int]) -> dict[int, Box | None]:
    """Extends the box of every object by those of all its descendants. Cycles of parents are broken."""
    extended = dict(boxes)
    for number, box in boxes.items():
        seen = {number}
        above = parents.get(number)
        while above is not None and above not in seen:
            extended[above] = unite_boxes(extended.get(above), box)
            seen.add(above)
            above = parents.get(above)
    return extended
