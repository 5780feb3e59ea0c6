"""Designs facades: floors, windows, doors, shops, colours and materials of a building."""

import itertools

import numpy as np

from map3d_town.models.building_model import AtlasTexture, Opening, PlainMaterial, RepeatingTexture

Outline = list[tuple[float, float]]
Color = tuple[int, int, int]

PLASTERS: tuple[Color, ...] = (
    (233, 214, 172), (238, 228, 206), (226, 190, 140), (214, 168, 124), (236, 205, 190), (205, 212, 196),
    (190, 203, 213), (242, 236, 224), (222, 200, 120), (201, 152, 116), (228, 180, 160), (213, 205, 190),
)  # fmt: skip
TRIMS: tuple[Color, ...] = ((246, 242, 232), (220, 208, 188), (150, 118, 92), (236, 230, 220))
SHUTTERS: tuple[Color, ...] = ((62, 92, 66), (96, 58, 42), (60, 84, 110), (122, 44, 40), (90, 100, 96))
SHOPS: tuple[Color, ...] = ((92, 62, 46), (48, 70, 62), (110, 42, 40), (60, 66, 84), (186, 176, 158))
BRICKS: tuple[Color, ...] = ((158, 82, 62), (140, 70, 54), (172, 104, 76), (186, 150, 118))
TIMBER: Color = (84, 56, 42)
TILES: tuple[Color, ...] = ((158, 88, 66), (146, 78, 60), (168, 100, 76), (136, 80, 64), (124, 72, 58))
DARK_TILES: tuple[Color, ...] = ((92, 84, 82), (110, 76, 66), (84, 88, 94))
ROMAN_WALLS: tuple[Color, ...] = ((226, 206, 172), (196, 92, 62), (214, 160, 88), (236, 226, 206), (206, 178, 136))


class TexturedFacadeDesign:
    """The textured design of one building: random colours, traits and roof colour."""

    def __init__(self, facade_kind: str, cover: str, storeys: int, eave_m: float, rng: np.random.Generator, deep: bool) -> None:
        self.facade_kind, self.storeys, self.rng, self.deep_openings = facade_kind, storeys, rng, deep
        self.floor_m = (eave_m - 0.4) / (storeys + 0.15)
        self.traits, self.colors = choose_facade_style(facade_kind, rng)
        self.cover = cover
        self.choose_roof_color = choose_roof_color(cover, rng)
        self.bay_m = float(rng.uniform(2.1, 2.7)) * {
            "slab": 1.35,
            "industrial": 2.2,
            "church": 2.0,
            "temple": 1.4,
            "gruender": 1.15,
            "villa": 1.3,
            "row": 1.25,
            "roman": 1.5,
        }.get(facade_kind, 1)
        self.party = "brick_red" if "brick" in self.traits else ("stone" if facade_kind in ("church", "wall", "arena") else "plaster")
        self.doors = 0

    def wall(self, side: str, width_m: float, outline: Outline, foot_m: float) -> AtlasTexture | RepeatingTexture | PlainMaterial:
        if side == "party" or (side == "blank" and self.cover in ("seats", "paving")):
            return RepeatingTexture(self.party, 4.0)
        height = max(t for _, t in outline)
        openings: tuple[Opening, ...] = ()
        floors = self.floors(foot_m, height)
        if side in ("street", "yard", "shop") and width_m > 1.6 and height > 2.6:
            openings = self.openings(side, width_m, outline, foot_m, floors)
        shop = any(o.kind == "shop" for o in openings)
        traits = self.traits | ({"shop"} if shop else set()) | ({"plain"} if side == "blank" else set())
        return AtlasTexture("facade", width_m, height, self.colors, openings, tuple(floors), frozenset(traits))

    def floors(self, foot_m: float, height_m: float) -> list[float]:
        """Returns the heights of the floors above the wall's foot, the ground floor first."""
        out = [foot_m]
        while out[-1] + self.floor_m * 1.15 < height_m and len(out) < 40:
            out.append(out[-1] + self.floor_m * (1.15 if len(out) == 1 else 1.0))
        return out

    def openings(self, side: str, width_m: float, outline: Outline, foot_m: float, floors: list[float]) -> tuple[Opening, ...]:
        """Returns the openings that fit the outline: windows in bays on every floor, doors and shops on the ground floor."""
        bays = max(1, int((width_m - 0.5) / self.bay_m))
        shop = side == "shop" or (side == "street" and self.facade_kind in ("house", "gruender") and self.rng.random() < 0.45)
        door = int(self.rng.integers(bays)) if side in ("street", "shop") or self.doors == 0 else -1
        out = []
        for f, z in enumerate(floors):
            for b in range(bays):
                middle = (b + 0.5) * width_m / bays
                opening = self._opening(f, b == door, shop, middle, z, width_m / bays)
                if opening and opening_fits(opening, outline, width_m):
                    out.append(opening)
                    self.doors += opening.kind == "door"
        return tuple(out)

    def _opening(self, floor: int, door: bool, shop: bool, middle: float, z: float, bay: float) -> Opening | None:
        if self.facade_kind in ("church", "temple", "arena"):
            return self._tall(floor, door, middle, z)
        if floor == 0 and door:
            gate = self.facade_kind == "industrial"
            width, height = (3.4, 3.6) if gate else (1.15, 2.25)
            return Opening("gate" if gate else "door", middle - width / 2, z, width, height)
        if floor == 0 and shop:
            return Opening("shop", middle - bay / 2 + 0.28, z + 0.4, bay - 0.56, self.floor_m * 0.7)
        width, height, sill = WINDOWS.get(self.facade_kind, WINDOWS["house"])
        height = min(height, self.floor_m - sill - 0.35)
        return Opening("window", middle - width / 2, z + sill, width, height) if height > 0.4 else None

    def _tall(self, floor: int, door: bool, middle: float, z: float) -> Opening | None:
        if floor == 0 and door:
            return Opening("door", middle - 0.9, z, 1.8, 3.2)
        height = self.floor_m * 0.62
        return Opening("arch", middle - 0.65, z + self.floor_m * 0.2, 1.3, height)

    def opening(self, opening: Opening) -> AtlasTexture | None:
        return None

    def roof(self, width_m: float, height_m: float, slope: float) -> AtlasTexture | RepeatingTexture | PlainMaterial:
        if self.cover == "seats":
            return RepeatingTexture("stone", 4.0)
        cover = "flat" if slope < 0.12 and self.cover not in ("metal", "paving") else self.cover
        color = choose_roof_color(cover, self.rng) if cover != self.cover else self.choose_roof_color
        return AtlasTexture("roof", width_m, height_m, (color,), traits=frozenset({cover}))

    def eaves(self) -> PlainMaterial:
        return PlainMaterial("eaves")


WINDOWS = {
    "house": (1.0, 1.5, 0.85), "timber": (0.9, 1.15, 0.9), "gruender": (1.15, 1.95, 0.75), "row": (1.4, 1.35, 0.9),
    "villa": (1.5, 1.4, 0.85), "slab": (2.0, 1.45, 0.9), "industrial": (3.6, 1.5, 1.6), "townhall": (1.2, 2.1, 0.8),
    "roman": (0.7, 0.8, 1.5), "wall": (0.35, 1.1, 1.8), "baths": (1.4, 1.6, 1.6), "shed": (0.8, 0.6, 1.4),
}  # fmt: skip


def opening_fits(opening: Opening, outline: Outline, width_m: float) -> bool:
    """Returns whether the opening is inside the wall, 0.2 m from its sides and 0.25 m below its upper edge."""
    a, b = opening.left_m, opening.left_m + opening.width_m
    if a < 0.2 or b > width_m - 0.2 or opening.low_m <= 0.05:
        return False
    inner = [q for p, q in outline if a - 0.2 < p < b + 0.2]
    return min(outline_height(outline, a - 0.2), outline_height(outline, b + 0.2), *inner) >= opening.low_m + opening.height_m + 0.25


def outline_height(outline: Outline, s: float) -> float:
    """Interpolates the height of an outline at `s`; constant beyond its ends."""
    for (a, low), (b, high) in itertools.pairwise(outline):
        if s < b:
            return low if s <= a else low + (high - low) * (s - a) / (b - a)
    return outline[-1][1]


def choose_facade_style(facade_kind: str, rng: np.random.Generator) -> tuple[frozenset[str], tuple[Color, ...]]:
    """Chooses the traits of a facade and its colours: wall, trim, window frame, shutters or accent, ground floor."""
    traits: set[str] = set()
    wall = vary_color(PLASTERS[rng.integers(len(PLASTERS))], rng)
    trim = TRIMS[rng.integers(len(TRIMS))]
    shutter = SHUTTERS[rng.integers(len(SHUTTERS))]
    frame: Color = (240, 238, 232) if rng.random() < 0.75 else (110, 82, 60)
    ground = SHOPS[rng.integers(len(SHOPS))]
    if facade_kind == "timber":
        traits |= {"timber"}
        wall = vary_color((236, 226, 202), rng)
    elif facade_kind in ("house", "villa", "row") and rng.random() < 0.4:
        traits |= {"shutters"}
    if facade_kind in ("house", "gruender", "row") and rng.random() < 0.18:
        traits |= {"brick"}
        wall = vary_color(BRICKS[rng.integers(len(BRICKS))], rng)
    if facade_kind in ("house", "gruender", "townhall"):
        traits |= {"cornice"}
    extra, wall = apply_special_style(facade_kind, wall, rng)
    return frozenset(traits | extra), (wall, trim, frame, shutter, ground)


def apply_special_style(facade_kind: str, wall: Color, rng: np.random.Generator) -> tuple[set[str], Color]:
    """Returns extra traits and the wall colour; public, industrial and Roman buildings have their own."""
    if facade_kind == "slab":
        return {"panel"}, vary_color([(224, 222, 214), (206, 196, 180), (190, 200, 204)][rng.integers(3)], rng)
    if facade_kind == "industrial":
        return {"ribs"}, vary_color([(176, 184, 188), (150, 164, 176), (196, 190, 176)][rng.integers(3)], rng)
    if facade_kind in ("church", "wall", "arena"):
        return {"ashlar"}, vary_color((198, 184, 158), rng)
    if facade_kind == "townhall":
        return {"quoins"}, vary_color((214, 150, 120), rng)
    if facade_kind == "temple":
        return {"ashlar"}, vary_color((238, 232, 220), rng)
    if facade_kind in ("roman", "baths"):
        return {"dado"}, vary_color(ROMAN_WALLS[rng.integers(len(ROMAN_WALLS))], rng)
    return set(), wall


def vary_color(color: Color, rng: np.random.Generator, sample_evenly: float = 7.0) -> Color:
    """Varies the brightness and hue of a colour slightly."""
    shift = rng.normal(0, sample_evenly) + rng.normal(0, sample_evenly / 3, 3)
    r, g, b = (int(np.clip(c + d, 8, 250)) for c, d in zip(color, shift, strict=True))
    return r, g, b


def choose_roof_color(cover: str, rng: np.random.Generator) -> Color:
    """Chooses the colour of a roof cover."""
    if cover == "tiles":
        return vary_color(TILES[rng.integers(len(TILES))], rng)
    if cover == "dark":
        return vary_color(DARK_TILES[rng.integers(len(DARK_TILES))], rng)
    colors: dict[str, Color] = {
        "slate": (88, 94, 104), "metal": (150, 158, 162), "copper": (112, 168, 146), "flat": (150, 148, 142),
        "paving": (206, 196, 176), "seats": (222, 214, 198), "roman": (174, 104, 76),
    }  # fmt: skip
    return vary_color(colors[cover], rng)


class UntexturedFacadeDesign:
    """The untextured design of sheds and garages."""

    deep_openings = False

    def wall(self, side: str, width_m: float, outline: Outline, foot_m: float) -> AtlasTexture | RepeatingTexture | PlainMaterial:
        return PlainMaterial("shed")

    def roof(self, width_m: float, height_m: float, slope: float) -> AtlasTexture | RepeatingTexture | PlainMaterial:
        return PlainMaterial("felt")

    def eaves(self) -> PlainMaterial:
        return PlainMaterial("eaves")

    def opening(self, opening: Opening) -> AtlasTexture | None:
        return None
