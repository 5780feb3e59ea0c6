"""Plans the town of a spec."""

from map3d_town.layout.ground_heights import Ground, make_ground
from map3d_town.layout.roman_layout import RomanLayout
from map3d_town.layout.streets import river_crossings, river_line
from map3d_town.layout.town_layout import TownLayout
from map3d_town.layout.town_plan import TownPlan
from map3d_town.town_spec import TownSpec


def plan_town(spec: TownSpec) -> tuple[TownPlan, Ground]:
    """Returns the plan and the ground; equal specs give equal plans."""
    if spec.style == "roman":
        return RomanLayout(spec.seed, spec.buildings).make_plan(), make_ground(spec.seed, spec.height_m)
    layout = TownLayout(spec.seed, spec.buildings)
    plan = layout.make_plan()
    river = tuple((float(x), float(y)) for x, y in river_line(layout.frame, layout.reach_m))
    return plan, make_ground(spec.seed, spec.height_m, river, layout.frame.river_half_m, river_crossings(layout.frame))
