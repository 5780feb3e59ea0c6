"""Writes trees as CityGML vegetation: instances of one prototype per species."""

import math
from typing import TextIO

from map3d_town.layout.town_plan import PlannedTree
from map3d_town.models.tree_prototypes import SPECIES, leaf_cards, trunk_faces
from map3d_town.polygons_2d import Points
from map3d_town.writers.citygml_writer import SharedAppearance, format_ring, format_texture


class TreeWriter:
    """Writes trees; the first tree of a species holds the prototype, the others link to it."""

    def __init__(self, out: TextIO, crs_offset: Points, shared: SharedAppearance, prefix: str) -> None:
        self.out, self.shared, self.prefix = out, shared, prefix
        self.crs_offset: list[float] = crs_offset.tolist()
        self.targets: dict[str, list[tuple[str, list[str]]]] = {}

    def write(self, tree: PlannedTree, number: int, ground_z: float) -> None:
        """Writes a tree as SolitaryVegetationObject."""
        c, s, h = math.cos(tree.turn) * tree.height_m, math.sin(tree.turn) * tree.height_m, tree.height_m
        matrix = f"{c:.6f} {-s:.6f} 0 0 {s:.6f} {c:.6f} 0 0 0 0 {h:.6f} 0 0 0 0 1"
        x, y, z = tree.x + self.crs_offset[0], tree.y + self.crs_offset[1], ground_z + self.crs_offset[2]
        crown = 2 * SPECIES[tree.species][0] * h
        self.out.write(
            f'<core:cityObjectMember><veg:SolitaryVegetationObject gml:id="{self.prefix}tree_{number:06d}"><gml:name>{tree.species}</gml:name>'
            f'<veg:class>1070</veg:class><veg:height uom="m">{h:.2f}</veg:height><veg:crownDiameter uom="m">{crown:.2f}</veg:crownDiameter>'
            f"<veg:lod2ImplicitRepresentation><core:ImplicitGeometry><core:transformationMatrix>{matrix}</core:transformationMatrix>"
            f'{self._format_geometry(tree.species)}<core:referencePoint><gml:Point><gml:pos srsDimension="3">{x:.4f} {y:.4f} {z:.4f}</gml:pos>'
            f"</gml:Point></core:referencePoint></core:ImplicitGeometry></veg:lod2ImplicitRepresentation>"
            f"</veg:SolitaryVegetationObject></core:cityObjectMember>\n"
        )

    def _format_geometry(self, species: str) -> str:
        """Formats the prototype of a species the first time, then a link to it."""
        name = f"{self.prefix}proto_{species}"
        if f"{species}_side" in self.targets:
            return f'<core:relativeGMLGeometry xlink:href="#{name}"/>'
        members = []
        for i, (ring, st, picture) in enumerate(leaf_cards(species)):
            polygon = f"{name}_p{i}"
            members.append(_format_polygon(polygon, ring))
            self.targets.setdefault(picture, []).append((polygon, [format_ring(st, 3)]))
        for i, ring in enumerate(trunk_faces(species)):
            members.append(_format_polygon(f"{name}_t{i}", ring))
            self.shared.plain["trunk"].append(f"{name}_t{i}")
        return f'<core:relativeGMLGeometry><gml:MultiSurface gml:id="{name}">{"".join(members)}</gml:MultiSurface></core:relativeGMLGeometry>'

    def write_leaf_textures(self) -> None:
        """Writes the leaf textures with their targets; call it once, after all trees."""
        if not self.targets:
            return
        body = "".join(format_texture(f"textures/{name}.png", "image/png", "none", targets) for name, targets in sorted(self.targets.items()))
        theme = "<app:theme>rgbTexture</app:theme>"
        self.out.write(f"<app:appearanceMember><app:Appearance>{theme}{body}</app:Appearance></app:appearanceMember>\n")


def _format_polygon(name: str, ring: Points) -> str:
    return (
        f'<gml:surfaceMember><gml:Polygon gml:id="{name}"><gml:exterior><gml:LinearRing gml:id="{name}_0">'
        f'<gml:posList srsDimension="3">{format_ring(ring, 5)}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>'
    )
