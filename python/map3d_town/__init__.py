"""Generates fictional towns: textured CityGML or OBJ with terrain and trees. Equal specs give equal bytes."""

from map3d_town.generator import TownReport, estimate_town, make_town
from map3d_town.town_errors import TownError
from map3d_town.town_spec import TownEstimate, TownSpec

__all__ = ["TownError", "TownEstimate", "TownReport", "TownSpec", "estimate_town", "make_town"]
