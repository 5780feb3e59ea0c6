"""Every kind of building of a large plan has closed shells and textures that fit an atlas."""

from collections import Counter

import pytest

from map3d_town import TownSpec
from map3d_town.layout.plan_town import plan_town
from map3d_town.models.building_geometry import build_model
from map3d_town.production_jobs import build_atlas

KINDS = {
    "town": {"church", "townhall", "monument", "house", "gruender", "row", "villa", "slab", "industrial", "shed"},
    "roman": {"temple", "basilica", "theatre", "amphitheatre", "baths", "macellum", "domus", "taberna", "wall", "tower", "gate", "tomb", "aqueduct"},
}


@pytest.mark.parametrize("style", ["town", "roman"])
def test_each_kind_is_closed_and_fits_an_atlas(style: str) -> None:
    plan, ground = plan_town(TownSpec(style=style, buildings=420, seed=3))
    first = {building.kind: building for building in reversed(plan.buildings)}
    assert KINDS[style] <= set(first)
    for kind, building in first.items():
        model = build_model(building, 3, ground, 1.0)
        assert (build_atlas([model], 1024) is None) == (kind == "shed")
        for body in model.bodies:
            faces = [f for s in body.shell for f in s.faces] + [f for s in body.shell for o in s.openings for f in o.faces]
            edges: Counter[tuple[tuple[float, ...], tuple[float, ...]]] = Counter()
            for ring in (r.tolist() for f in faces for r in f.rings):
                edges.update((tuple(a), tuple(b)) for a, b in zip(ring, ring[1:] + ring[:1], strict=True))
            assert set(edges.values()) == {1}, kind
            assert all((b, a) in edges for a, b in edges), kind


@pytest.mark.parametrize("buildings", [60, 600])
def test_each_address_stands_once(buildings: int) -> None:
    plan, _ = plan_town(TownSpec(buildings=buildings, seed=3))
    addresses = [(building.street, building.house_number) for building in plan.buildings if building.street]
    assert len(addresses) > buildings / 2
    assert len(set(addresses)) == len(addresses)
