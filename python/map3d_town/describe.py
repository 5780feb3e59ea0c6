"""The attributes of buildings: names, years, addresses, generic attributes."""

from map3d_town.citygml import About
from map3d_town.house import Built
from map3d_town.seeds import rng
from map3d_town.spec import TownSpec

YEARS = {
    "house": (1480, 1780), "church": (1290, 1450), "townhall": (1510, 1620), "gruender": (1868, 1912), "row": (1924, 1985), "villa": (1905, 2015),
    "slab": (1958, 1979), "industrial": (1950, 2005), "office": (1965, 2018), "shed": (1950, 2020), "monument": (1560, 1890),
}  # fmt: skip
NAMES = {
    "church": "St. Martin", "townhall": "Rathaus", "monument": "Marktbrunnen", "industrial": "Werkhalle", "office": "Bürohaus", "slab": "Wohnblock",
    "shed": "Nebengebäude", "temple": "Templum Iovis", "basilica": "Basilica", "theatre": "Theatrum", "baths": "Thermae", "gate": "Porta",
    "tower": "Turris", "wall": "Murus", "curia": "Curia", "macellum": "Macellum", "amphitheatre": "Amphitheatrum", "domus": "Domus",
    "insula": "Insula",
}  # fmt: skip
HEATING = ("district heating", "gas", "heat pump", "oil", "wood pellets")


def describe(built: Built, spec: TownSpec) -> About:
    """What is known of a building besides its geometry."""
    lot = built.lot
    source = rng(spec.seed, "about", lot.number)
    roman = spec.style == "roman"
    low, high = (20, 180) if roman else YEARS.get(lot.kind, (1850, 2000))
    year = int(source.integers(low, high))
    title = NAMES.get(lot.kind) or (f"{lot.street} {lot.house_number}" if lot.street else lot.kind)
    height = max(body.top_z for body in built.bodies) - built.ground_z
    extra: list[tuple[str, str, str]] = [("string", "buildingKind", lot.kind), ("double", "footprintHeight", f"{built.ground_z:.2f}")]
    if not roman and lot.kind in ("house", "villa", "row", "gruender", "slab"):
        extra.append(("string", "heating", HEATING[int(source.integers(len(HEATING)))]))
        extra.append(("int", "dwellings", str(1 if lot.kind in ("villa", "row") else 1 + int(source.integers(1, 3 * lot.parts[0].storeys)))))
        extra.append(("double", "energyDemand_kWh_m2a", f"{source.uniform(45, 240):.1f}"))
    return About(
        id=f"town{spec.seed}_b{lot.number:06d}", name=title, function=lot.function, year=year, height_m=float(height),
        storeys=max(part.storeys for part in lot.parts), street=lot.street, house_number=lot.house_number, town=spec.name,
        country="Imperium Romanum" if roman else "Germany", extra=tuple(extra),
    )  # fmt: skip
