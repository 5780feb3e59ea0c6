"""Makes towns: textured CityGML or OBJ with terrain and trees, the same bytes for the same arguments."""

from map3d_town.errors import TownError
from map3d_town.make import TownReport, estimate_town, make_town
from map3d_town.spec import Estimate, TownSpec

__all__ = ["Estimate", "TownError", "TownReport", "TownSpec", "estimate_town", "make_town"]
