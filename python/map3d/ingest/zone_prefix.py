"""Eastings with the number of the zone before them, or without it: 32691000 where a coordinate system expects 691000, or the other way round."""

from collections.abc import Iterator
from typing import Final

from pyproj import CRS

PREFIX_M: Final = 1_000_000.0
"""The number of the zone counts millions of metres."""
_UTM_SCALE: Final = 0.9996
_METHOD: Final = "Transverse Mercator"


def prefix_shifts_m(horizontal: CRS) -> Iterator[float]:
    """Yields what to add to eastings that have, or lack, the number of the zone, other than a projected CRS expects."""
    operation = horizontal.coordinate_operation
    if operation is None or operation.method_name != _METHOD or any(axis.unit_conversion_factor != 1.0 for axis in horizontal.axis_info):
        return
    values = {parameter.name: float(parameter.value) for parameter in operation.params}
    meridian, false_easting = values.get("Longitude of natural origin"), values.get("False easting")
    if meridian is None or false_easting is None:
        return
    own = false_easting // PREFIX_M
    if own:
        yield own * PREFIX_M
        return
    is_utm = values.get("Scale factor at natural origin") == _UTM_SCALE
    zones = {(meridian + 183.0) / 6.0} if is_utm else {meridian / 3.0, (meridian + 3.0) / 6.0}
    yield from (-zone * PREFIX_M for zone in sorted(zones) if zone > 0 and zone == round(zone))
