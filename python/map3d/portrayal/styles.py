"""The styles of layers: what takes the place of the colours of textures and materials."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from map3d.portrayal.service_exception import ServiceException, quote


@dataclass(frozen=True)
class PortrayalStyle:
    name: str
    title: str
    abstract: str


STYLES: Final[Mapping[str, PortrayalStyle]] = {
    style.name: style
    for style in (
        PortrayalStyle("textured", "Textures and materials", "The colours of textures and materials, without light"),
        PortrayalStyle(
            "white", "White model", "White surfaces without textures, darker the more they turn away from a lamp in the south-west, high in the sky"
        ),
        PortrayalStyle("objects", "Colours by object", "A colour of its own for each object, derived from its id, shaded like the white model"),
    )
}
"""By name, in the order of the capabilities."""
DEFAULT_STYLE: Final = next(iter(STYLES))
STYLE_KINDS: Final = ("color", "normal", "id")
"""The layers of a G-buffer that a style other than the default one is computed from."""

_WHITE: Final = 244.0
_LAMP: Final = (-0.36, -0.48, 0.8)
"""Unit vector towards the lamp."""
_AMBIENT: Final = 0.66
_SATURATION: Final = 0.42
_NEIGHBOURS: Final = ((0, 1), (0, -1), (1, 0), (-1, 0))

Arrays = Mapping[str, NDArray[Any]]


def find_style(name: str) -> str:
    """Returns the name of a style, the default one for an empty name. Raises StyleNotDefined."""
    if name and name not in STYLES:
        raise ServiceException("StyleNotDefined", f"no style {quote(name)}; expected {', '.join(STYLES)}", name)
    return name or DEFAULT_STYLE


def styled_color(style: str, arrays: Arrays) -> NDArray[np.uint8]:
    """Returns the colours (h, w, 4) of a view in a style. `arrays`: `STYLE_KINDS`, ids as the scene counts them.

    Opacities stay those of the surfaces; colours are those of the surface at the pixel's centre.
    """
    color: NDArray[np.uint8] = arrays["color"]
    if style == DEFAULT_STYLE:
        return color
    normal, ids = _fill_borders(arrays["normal"], arrays["id"], color[..., 3] > 0)
    visible = color[..., 3] > 0
    base = np.full((*ids.shape, 3), _WHITE, np.float32) if style == "white" else _object_colors(ids)
    shaded = np.rint(base * _shades(normal)[..., None])
    styled = np.concatenate([shaded.astype(np.uint8), color[..., 3:]], axis=-1)
    styled[~visible] = 0
    return styled


def _shades(normal: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Returns the share of light that surfaces reflect, 0.32 to 1."""
    directions = normal.astype(np.float32) / np.float32(127.5) - np.float32(1)
    towards_lamp = directions @ np.array(_LAMP, np.float32)
    shades: NDArray[np.float32] = np.clip(np.float32(_AMBIENT) + np.float32(1 - _AMBIENT) * towards_lamp, 0, 1)
    return shades


def _object_colors(ids: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Returns bright colours (h, w, 3) that depend on nothing but the ids. Neighbouring ids have hues far apart."""
    hue = ids.astype(np.float64) * 0.6180339887498949 % 1.0
    phases = (hue[..., None] + np.array([0.0, 2 / 3, 1 / 3])) * (2 * np.pi)
    colors: NDArray[np.float32] = (_WHITE * (1 - _SATURATION * (0.5 - 0.5 * np.cos(phases)))).astype(np.float32)
    return colors


def _fill_borders(normal: NDArray[np.uint8], ids: NDArray[np.uint32], visible: NDArray[np.bool_]) -> tuple[NDArray[np.uint8], NDArray[np.uint32]]:
    """Gives pixels whose centre lies beside the surfaces that they show partly the surface of a neighbouring pixel."""
    normal, ids = normal.copy(), ids.copy()
    known: NDArray[np.bool_] = np.any(normal, axis=-1)
    missing: NDArray[np.bool_] = np.logical_and(visible, np.logical_not(known))
    rows, columns = np.nonzero(missing)
    for down, right in _NEIGHBOURS:
        y, x = np.clip(rows + down, 0, ids.shape[0] - 1), np.clip(columns + right, 0, ids.shape[1] - 1)
        usable = known[y, x] & missing[rows, columns]
        into, source = (rows[usable], columns[usable]), (y[usable], x[usable])
        normal[into], ids[into], missing[into] = normal[source], ids[source], False
    normal[missing] = (127, 127, 255)
    return normal, ids
