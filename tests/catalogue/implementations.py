"""The implementations of the catalogue, and a rendering to store in them."""

from collections.abc import Callable
from pathlib import Path

from map3d.catalogue import Catalogue, RenderingRecord
from map3d.catalogue.sqlite import SqliteCatalogue
from map3d.geometry.frames import pin
from map3d.types import Layer, ViewAngles

LEASE_S = 0.5
BOX = ((0.0, 0.0, 0.0), (100.0, 100.0, 10.0))


def _sqlite(folder: Path) -> Callable[[float], Catalogue]:
    return lambda lease_s: SqliteCatalogue(folder / "catalogue.sqlite", lease_s=lease_s)


IMPLEMENTATIONS = {"sqlite": _sqlite}


def rendering(name: str = "town-a") -> RenderingRecord:
    frames = tuple(pin(BOX, 256, 0.01, [ViewAngles(0, 45)]))
    return RenderingRecord(name, "town", 0.01, ((Layer("color", "color", "webp", 80), Layer("id", "id", "png")),), frames, BOX)
