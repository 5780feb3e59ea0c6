"""Trees as CityGML vegetation: a prototype of leaf cards and a trunk per species, placed by transformation matrices."""

import math
from typing import TextIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from map3d_town.citygml import Looks, ring_text, texture
from map3d_town.model import Tree
from map3d_town.seeds import rng

Points = NDArray[np.float64]
LEAF_PX = 256
# crown radius and trunk height as parts of the tree's height, crown colour, shape of the silhouette
SPECIES: dict[str, tuple[float, float, tuple[int, int, int], str]] = {
    "linden": (0.34, 0.24, (88, 124, 52), "round"), "chestnut": (0.40, 0.22, (70, 106, 44), "round"),
    "apple": (0.44, 0.26, (112, 142, 70), "round"), "poplar": (0.15, 0.12, (96, 126, 58), "column"),
    "fir": (0.24, 0.10, (44, 78, 52), "cone"), "cypress": (0.11, 0.06, (48, 74, 44), "column"),
    "pine": (0.42, 0.62, (66, 98, 50), "umbrella"), "olive": (0.42, 0.30, (134, 146, 104), "round"),
}  # fmt: skip


def cards(species: str) -> list[tuple[Points, Points, str]]:
    """The quadrilaterals of a tree of height 1 on the origin: ring (4, 3), texture coordinates (4, 2), picture name.

    Five upright cards through the trunk at even angles, two leaning ones, and level ones at three heights, so that the crown looks full
    from the side and from above.
    """
    radius, trunk, _, shape = SPECIES[species]
    low, quads = trunk * 0.8, []
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    for i in range(4):
        a = np.pi * i / 4
        side = np.array([np.cos(a), np.sin(a), 0.0]) * radius
        foot, top = np.array([0, 0, low]), np.array([0, 0, 1.0])
        quads.append((np.array([foot - side, foot + side, top + side, top - side]), square, f"{species}_side"))
    for i, (level, share) in enumerate(_levels(shape)):
        z, r, turn = low + (1 - low) * level, radius * share, 0.5 * i
        x, y = np.array([np.cos(turn), np.sin(turn), 0.12]) * r, np.array([-np.sin(turn), np.cos(turn), -0.1]) * r
        centre = np.array([0, 0, z])
        quads.append((np.array([centre - x - y, centre + x - y, centre + x + y, centre - x + y]), square, f"{species}_top"))
    return [(ring.round(5), st, name) for ring, st, name in quads]


def _levels(shape: str) -> tuple[tuple[float, float], ...]:
    """Height and width of the level cards, as parts of the crown."""
    if shape == "cone":
        return ((0.12, 0.95), (0.34, 0.74), (0.56, 0.5), (0.78, 0.26))
    if shape == "column":
        return ((0.25, 0.95), (0.55, 0.95), (0.8, 0.7))
    return ((0.28, 0.9), (0.5, 1.0), (0.7, 0.86), (0.87, 0.55))


def trunk(species: str) -> list[Points]:
    """Six upright quadrilaterals of a tree of height 1."""
    radius, height = 0.022, SPECIES[species][1] + 0.12
    angle = np.arange(7) * (np.pi / 3)
    low = np.stack([np.cos(angle) * radius, np.sin(angle) * radius, np.full(7, -0.03)], axis=1)
    high = np.stack([np.cos(angle) * radius * 0.6, np.sin(angle) * radius * 0.6, np.full(7, height)], axis=1)
    return [np.array([low[i], low[i + 1], high[i + 1], high[i]]).round(5) for i in range(6)]


def leaf_picture(name: str) -> NDArray[np.uint8]:
    """(256, 256, 4): clusters of leaves in the crown's silhouette; alpha is 0 or 255, colour is leaf-like also where alpha is 0."""
    species, view = name.rsplit("_", 1)
    _, _, color, shape = SPECIES[species]
    source = rng(11, "leaves", name)
    big = LEAF_PX * 2
    image = Image.new("RGBA", (big, big), (*_shaded(color, 0.7), 0))
    draw = ImageDraw.Draw(image)
    points = source.uniform(0, 1, (3600, 2))
    inside = points[_in_crown(points, shape if view == "side" else "disc", source)]
    clumps = source.uniform(0.1, 0.9, (26, 2))
    order = np.argsort(inside[:, 1] if view == "side" else -np.hypot(*(inside - 0.5).T))
    for x, y in inside[order]:
        near = float(np.hypot(*(clumps - [x, y]).T).min())
        light = (
            0.62 + 0.5 * y + source.normal(0, 0.13) - 1.1 * min(near, 0.2)
            if view == "side"
            else 1.12 + source.normal(0, 0.14) - 1.4 * min(near, 0.25)
        )
        size = source.uniform(7, 14)
        box = [x * big - size, (1 - y) * big - size * 0.7, x * big + size, (1 - y) * big + size * 0.7]
        draw.ellipse(box, fill=(*_shaded(color, light), 255))
    small = np.asarray(image.resize((LEAF_PX, LEAF_PX), Image.Resampling.BOX)).copy()
    small[..., 3] = np.where(small[..., 3] >= 128, 255, 0)
    small[small[..., 3] == 0, :3] = _shaded(color, 0.7)
    return small


def _in_crown(points: Points, shape: str, source: np.random.Generator) -> NDArray[np.bool_]:
    """Which points lie in the silhouette, with a ragged edge and some holes."""
    x, y = (points[:, 0] - 0.5) * 2, points[:, 1]
    ragged = 1 + 0.1 * np.sin(9 * np.arctan2(y - 0.5, x)) + source.normal(0, 0.05, len(x))
    reach = {
        "round": np.sqrt(np.clip(1 - (2 * y - 1) ** 2, 0, 1)), "disc": np.sqrt(np.clip(1 - (2 * y - 1) ** 2, 0, 1)),
        "column": np.sin(np.pi * np.clip(y, 0, 1) ** 0.8) ** 0.9,
        "cone": (1 - y) * (0.78 + 0.22 * np.cos(y * 34)), "umbrella": np.sqrt(np.clip(1 - (2 * y - 1) ** 2, 0, 1)) * 0.97,
    }[shape]  # fmt: skip
    return np.asarray(np.abs(x) < reach * np.minimum(ragged * 0.93, 1.0))


def _shaded(color: tuple[int, int, int], light: float) -> tuple[int, int, int]:
    r, g, b = (min(255, max(0, int(c * light))) for c in color)
    return r, g, b


class TreeWriter:
    """Writes trees one after another; the first of each species carries the prototype, the others point to it."""

    def __init__(self, out: TextIO, shift: Points, looks: Looks, prefix: str) -> None:
        self.out, self.looks, self.prefix = out, looks, prefix
        self.shift: list[float] = shift.tolist()
        self.targets: dict[str, list[tuple[str, list[str]]]] = {}

    def write(self, tree: Tree, number: int, ground_z: float) -> None:
        """A solitary vegetation object of height `tree.height_m`."""
        c, s, h = math.cos(tree.turn) * tree.height_m, math.sin(tree.turn) * tree.height_m, tree.height_m
        matrix = f"{c:.6f} {-s:.6f} 0 0 {s:.6f} {c:.6f} 0 0 0 0 {h:.6f} 0 0 0 0 1"
        x, y, z = tree.x + self.shift[0], tree.y + self.shift[1], ground_z + self.shift[2]
        crown = 2 * SPECIES[tree.species][0] * h
        self.out.write(
            f'<core:cityObjectMember><veg:SolitaryVegetationObject gml:id="{self.prefix}tree_{number:06d}"><gml:name>{tree.species}</gml:name>'
            f'<veg:class>1070</veg:class><veg:height uom="m">{h:.2f}</veg:height><veg:crownDiameter uom="m">{crown:.2f}</veg:crownDiameter>'
            f"<veg:lod2ImplicitRepresentation><core:ImplicitGeometry><core:transformationMatrix>{matrix}</core:transformationMatrix>"
            f'{self.geometry(tree.species)}<core:referencePoint><gml:Point><gml:pos srsDimension="3">{x:.4f} {y:.4f} {z:.4f}</gml:pos>'
            f"</gml:Point></core:referencePoint></core:ImplicitGeometry></veg:lod2ImplicitRepresentation>"
            f"</veg:SolitaryVegetationObject></core:cityObjectMember>\n"
        )

    def geometry(self, species: str) -> str:
        """The prototype the first time, a link to it later."""
        name = f"{self.prefix}proto_{species}"
        if f"{species}_side" in self.targets:
            return f'<core:relativeGMLGeometry xlink:href="#{name}"/>'
        members = []
        for i, (ring, st, picture) in enumerate(cards(species)):
            polygon = f"{name}_p{i}"
            members.append(_polygon(polygon, ring))
            self.targets.setdefault(picture, []).append((polygon, [ring_text(st, 3)]))
        for i, ring in enumerate(trunk(species)):
            members.append(_polygon(f"{name}_t{i}", ring))
            self.looks.plains["trunk"].append(f"{name}_t{i}")
        return f'<core:relativeGMLGeometry><gml:MultiSurface gml:id="{name}">{"".join(members)}</gml:MultiSurface></core:relativeGMLGeometry>'

    def appearance(self) -> None:
        """The leaf textures, once at the end."""
        if not self.targets:
            return
        body = "".join(texture(f"textures/{name}.png", "image/png", "none", targets) for name, targets in sorted(self.targets.items()))
        theme = "<app:theme>rgbTexture</app:theme>"
        self.out.write(f"<app:appearanceMember><app:Appearance>{theme}{body}</app:Appearance></app:appearanceMember>\n")


def _polygon(name: str, ring: Points) -> str:
    return (
        f'<gml:surfaceMember><gml:Polygon gml:id="{name}"><gml:exterior><gml:LinearRing gml:id="{name}_0">'
        f'<gml:posList srsDimension="3">{ring_text(ring, 5)}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>'
    )
