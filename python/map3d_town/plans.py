"""From a spec to the plan of its town and the ground under it."""

from map3d_town.ground import Ground, make_ground
from map3d_town.layout import TownPlan
from map3d_town.layout_roman import RomanPlan
from map3d_town.model import Plan
from map3d_town.spec import TownSpec
from map3d_town.streets import river_crossings, river_line


def plan_town(spec: TownSpec) -> tuple[Plan, Ground]:
    """The plan and the ground; the same for the same spec."""
    if spec.style == "roman":
        return RomanPlan(spec.seed, spec.buildings).draw(), make_ground(spec.seed, spec.height_m)
    drawn = TownPlan(spec.seed, spec.buildings)
    plan = drawn.draw()
    line = river_line(drawn.frame, drawn.reach_m)
    river = tuple((float(x), float(y)) for x, y in line)
    return plan, make_ground(spec.seed, spec.height_m, river, drawn.frame.river_half_m, river_crossings(drawn.frame))
