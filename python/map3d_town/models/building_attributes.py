"""Attributes of buildings: names, years, addresses, generic attributes."""

from dataclasses import dataclass

from map3d_town.models.building_model import BuildingModel
from map3d_town.seeds import rng
from map3d_town.town_spec import TownSpec

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


@dataclass(frozen=True)
class BuildingAttributes:
    """The attributes of a building. `function`: code of the AdV, empty for none; `generic`: ("string" | "int" | "double", name, value)."""

    id: str
    name: str
    function: str
    year: int
    height_m: float
    storeys: int
    street: str
    house_number: int
    town: str
    country: str
    generic: tuple[tuple[str, str, str], ...]


def describe_building(model: BuildingModel, spec: TownSpec) -> BuildingAttributes:
    """Returns the attributes of a building; years and energy figures are random."""
    building = model.plan
    source = rng(spec.seed, "about", building.number)
    roman = spec.style == "roman"
    low, high = (20, 180) if roman else YEARS.get(building.kind, (1850, 2000))
    year = int(source.integers(low, high))
    title = NAMES.get(building.kind) or (f"{building.street} {building.house_number}" if building.street else building.kind)
    height = max(body.top_z for body in model.bodies) - model.ground_z
    generic: list[tuple[str, str, str]] = [("string", "buildingKind", building.kind), ("double", "footprintHeight", f"{model.ground_z:.2f}")]
    if not roman and building.kind in ("house", "villa", "row", "gruender", "slab"):
        generic.append(("string", "heating", HEATING[int(source.integers(len(HEATING)))]))
        dwellings = 1 if building.kind in ("villa", "row") else 1 + int(source.integers(1, 3 * building.parts[0].storeys))
        generic.append(("int", "dwellings", str(dwellings)))
        generic.append(("double", "energyDemand_kWh_m2a", f"{source.uniform(45, 240):.1f}"))
    return BuildingAttributes(
        id=f"town{spec.seed}_b{building.number:06d}", name=title, function=building.function, year=year, height_m=float(height),
        storeys=max(part.storeys for part in building.parts), street=building.street, house_number=building.house_number, town=spec.name,
        country="Imperium Romanum" if roman else "Germany", generic=tuple(generic),
    )  # fmt: skip
