"""The projections of GetView: their parameters in the order of the capabilities, and the camera of a request (OGC 15-001r4 §10.2.2)."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Final

from map3d.portrayal.scalars import parse_number
from map3d.portrayal.service_exception import invalid, quote

NEAR_M: Final = {"Perspective": 0.1, "Orthographic": 0.0}
FAR_M: Final = 100_000.0
FOVX_DEG: Final = 60.0
FOVY_DEFAULT: Final = "derived from FOVX and the aspect ratio"
BORDER_M: Final = 100.0
FOV_DEG: Final = (0.001, 179.0)
"""Least and greatest field of view."""


@dataclass(frozen=True)
class ProjectionParameter:
    """`default`: None if the parameter is required. `group`: the name of the parameter's position, or its own name."""

    name: str
    group: str
    default: str | None
    unit: str
    meaning: str

    @property
    def required(self) -> bool:
        return self.default is None


@dataclass(frozen=True)
class Projection:
    name: str
    title: str
    parameters: tuple[ProjectionParameter, ...]

    def groups(self) -> Iterator[tuple[str, list[str]]]:
        """Yields each position or parameter with the names of its numbers."""
        for group, members in groupby(self.parameters, key=lambda parameter: parameter.group):
            yield group, [member.name for member in members]


def _position(group: str, default: Sequence[str | None], meaning: str) -> list[ProjectionParameter]:
    return [
        ProjectionParameter(f"{group}.{axis}", group, value, "units of the request CRS", f"{meaning}, coordinate {axis[1]}")
        for axis, value in zip(("X1", "X2", "X3"), default, strict=True)
    ]


def _number(name: str, default: str, unit: str, meaning: str) -> ProjectionParameter:
    return ProjectionParameter(name, name, default, unit, meaning)


def _camera_parameters() -> list[ProjectionParameter]:
    return [
        *_position("POC", (None, None, None), "position of the camera"),
        *_position("POI", (None, None, None), "point of interest, which the camera looks at"),
        *_position("UP", ("0", "0", "1"), "upward direction, or the position of a point in that direction from the POC"),
    ]


def _planes(name: str) -> list[ProjectionParameter]:
    return [
        _number("NearPlane", f"{NEAR_M[name]:g}", "metre", "distance of the near clipping plane from the POC"),
        _number("FarPlane", f"{FAR_M:g}", "metre", "distance of the far clipping plane from the POC"),
    ]


PROJECTIONS: Final[Mapping[str, Projection]] = {
    "Perspective": Projection(
        "Perspective",
        "Perspective projection",
        (
            *_camera_parameters(),
            _number("FOVX", f"{FOVX_DEG:g}", "degree", "horizontal field of view; derived from FOVY and the aspect ratio if only FOVY is given"),
            _number("FOVY", FOVY_DEFAULT, "degree", "vertical field of view"),
            *_planes("Perspective"),
        ),
    ),
    "Orthographic": Projection(
        "Orthographic",
        "Orthographic projection",
        (
            *_camera_parameters(),
            _number("Left", f"{-BORDER_M:g}", "metre", "left border of the image, from the line through POC and POI"),
            _number("Right", f"{BORDER_M:g}", "metre", "right border of the image"),
            _number("Bottom", f"{-BORDER_M:g}", "metre", "lower border of the image"),
            _number("Top", f"{BORDER_M:g}", "metre", "upper border of the image"),
            *_planes("Orthographic"),
        ),
    ),
}


@dataclass(frozen=True)
class ProjectionRequest:
    """A projection as requested: `values` by parameter name, without those that were left empty."""

    projection: Projection
    values: Mapping[str, float]

    def position(self, group: str) -> tuple[float, float, float] | None:
        """Returns the numbers of a position, None if it was left empty."""
        found = [self.values.get(f"{group}.{axis}") for axis in ("X1", "X2", "X3")]
        return None if found[0] is None or found[1] is None or found[2] is None else (found[0], found[1], found[2])

    def window(self, width_px: int, height_px: int) -> tuple[float, float, float, float]:
        """Returns (left, right, bottom, top): metres, or tangents in perspective. Raises InvalidParameterValue."""
        if self.projection.name == "Perspective":
            x, y = _tangents(self.values.get("FOVX"), self.values.get("FOVY"), width_px / height_px)
            return (-x, x, -y, y)
        left, right, bottom, top = (self.values.get(name, default) for name, default in _BORDERS)
        if not (left < right and bottom < top):
            raise invalid("portrayals", f"Left {left:g}, Right {right:g}, Bottom {bottom:g}, Top {top:g}: expected Left < Right and Bottom < Top")
        return (left, right, bottom, top)

    def planes(self) -> tuple[float, float]:
        """Returns the distances of the near and the far plane. Raises InvalidParameterValue."""
        perspective = self.projection.name == "Perspective"
        near, far = self.values.get("NearPlane", NEAR_M[self.projection.name]), self.values.get("FarPlane", FAR_M)
        if not (near < far and (near > 0 or not perspective)):
            raise invalid("portrayals", f"NearPlane {near:g}, FarPlane {far:g}: expected NearPlane < FarPlane{', both positive' * perspective}")
        return near, far


_BORDERS: Final = (("Left", -BORDER_M), ("Right", BORDER_M), ("Bottom", -BORDER_M), ("Top", BORDER_M))


def parse_projection(items: Sequence[str], locator: str) -> ProjectionRequest:
    """Parses the tuple of a projection: its identifier and one value per parameter; optional values may be empty, and missing at the end.

    Raises InvalidParameterValue.
    """
    name = items[0] if items else ""
    projection = next((one for key, one in PROJECTIONS.items() if key.lower() == name.lower()), None)
    if projection is None:
        raise invalid(locator, f"no projection {quote(name)}; expected {' or '.join(PROJECTIONS)}")
    given = list(items[1:])
    if len(given) > len(projection.parameters):
        raise invalid(locator, f"{name} has {len(given)} values, expected {len(projection.parameters)}")
    given += [""] * (len(projection.parameters) - len(given))
    values: dict[str, float] = {}
    for parameter, text in zip(projection.parameters, given, strict=True):
        if text:
            values[parameter.name] = parse_number(text, locator)
        elif parameter.required:
            raise invalid(locator, f"{name}: {parameter.name} is missing")
    up = [f"UP.X{k}" in values for k in (1, 2, 3)]
    if any(up) and not all(up):
        raise invalid(locator, f"{name}: UP needs three coordinates")
    return ProjectionRequest(projection, values)


def _tangents(fovx_deg: float | None, fovy_deg: float | None, aspect: float) -> tuple[float, float]:
    for angle in (fovx_deg, fovy_deg):
        if angle is not None and not FOV_DEG[0] <= angle <= FOV_DEG[1]:
            raise invalid("portrayals", f"field of view of {angle:g}°, expected {FOV_DEG[0]:g} to {FOV_DEG[1]:g}")
    y = None if fovy_deg is None else math.tan(math.radians(fovy_deg) / 2)
    if fovx_deg is None and y is not None:
        return y * aspect, y
    x = math.tan(math.radians(FOVX_DEG if fovx_deg is None else fovx_deg) / 2)
    return x, x / aspect if y is None else y
