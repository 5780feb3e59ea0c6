"""Writes buildings as CityGML 2.0 one by one, so memory does not grow with the file."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from html import escape
from typing import TextIO

import numpy as np

from map3d_town.models.building_attributes import BuildingAttributes
from map3d_town.models.building_model import (
    ROOF,
    AtlasTexture,
    BoundarySurface,
    BuildingModel,
    PartGeometry,
    PlainMaterial,
    RepeatingTexture,
    TexturedFace,
)
from map3d_town.polygons_2d import Points
from map3d_town.textures.shared_materials import DIFFUSE_COLORS
from map3d_town.textures.texture_atlas import TextureAtlas

THEME = "rgbTexture"
NAMESPACES = {
    "core": "http://www.opengis.net/citygml/2.0", "bldg": "http://www.opengis.net/citygml/building/2.0",
    "app": "http://www.opengis.net/citygml/appearance/2.0", "gen": "http://www.opengis.net/citygml/generics/2.0",
    "veg": "http://www.opengis.net/citygml/vegetation/2.0", "gml": "http://www.opengis.net/gml",
    "xlink": "http://www.w3.org/1999/xlink", "xAL": "urn:oasis:names:tc:ciq:xsdschema:xAL:2.0",
    "xsi": "http://www.w3.org/2001/XMLSchema-instance",
}  # fmt: skip
SCHEMAS = {
    "building": "http://www.opengis.net/citygml/building/2.0 http://schemas.opengis.net/citygml/building/2.0/building.xsd",
    "appearance": "http://www.opengis.net/citygml/appearance/2.0 http://schemas.opengis.net/citygml/appearance/2.0/appearance.xsd",
    "generics": "http://www.opengis.net/citygml/generics/2.0 http://schemas.opengis.net/citygml/generics/2.0/generics.xsd",
    "vegetation": "http://www.opengis.net/citygml/vegetation/2.0 http://schemas.opengis.net/citygml/vegetation/2.0/vegetation.xsd",
}


@dataclass
class SharedAppearance:
    """Repeating textures and plain materials with their targets, collected for the end of the file."""

    repeating: dict[RepeatingTexture, list[tuple[str, list[str]]]] = field(default_factory=lambda: defaultdict(list))
    plain: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))


def write_head(out: TextIO, name: str, srs: str, low: Points, high: Points, modules: Iterable[str]) -> None:
    """Writes the head of a file with its envelope; `modules`: keys of SCHEMAS."""
    spaces = " ".join(f'xmlns:{k}="{v}"' for k, v in NAMESPACES.items())
    schemas = " ".join(SCHEMAS[m] for m in modules)
    out.write(f'<?xml version="1.0" encoding="UTF-8"?>\n<core:CityModel {spaces} xsi:schemaLocation="{schemas}">\n')
    out.write(f"<gml:name>{escape(name)}</gml:name>\n")
    out.write(f'<gml:boundedBy><gml:Envelope srsName="{srs}" srsDimension="3">')
    out.write(f"<gml:lowerCorner>{format_numbers(low, 3)}</gml:lowerCorner><gml:upperCorner>{format_numbers(high, 3)}</gml:upperCorner>")
    out.write("</gml:Envelope></gml:boundedBy>\n")


def write_foot(out: TextIO, shared: SharedAppearance) -> None:
    """Writes the shared appearance and the end of the file."""
    if shared.repeating or shared.plain:
        out.write(f"<app:appearanceMember><app:Appearance><app:theme>{THEME}</app:theme>\n")
        for repeating, targets in sorted(shared.repeating.items(), key=lambda item: (item[0].name, item[0].size_m)):
            out.write(format_texture(f"textures/{repeating.name}.jpg", "image/jpeg", "wrap", targets))
        for name, ids in sorted(shared.plain.items()):
            out.write(format_material(name, ids))
        out.write("</app:Appearance></app:appearanceMember>\n")
    out.write("</core:CityModel>\n")


def format_numbers(values: Iterable[float], decimals: int) -> str:
    """Formats the values with `decimals` decimals, separated by spaces."""
    every = tuple(values)
    return _format(len(every), decimals) % every


@lru_cache(maxsize=1024)
def _format(count: int, decimals: int) -> str:
    """Returns one format string for all numbers of a ring, which is twice as fast as one per number."""
    return " ".join([f"%.{decimals}f"] * count)


def format_texture(uri: str, mime: str, mode: str, targets: list[tuple[str, list[str]]]) -> str:
    """Formats a texture with its targets: polygon id and one formatted coordinate list per ring."""
    parts = [
        "<app:surfaceDataMember><app:ParameterizedTexture>"
        f"<app:imageURI>{uri}</app:imageURI><app:mimeType>{mime}</app:mimeType>"
        f"<app:textureType>specific</app:textureType><app:wrapMode>{mode}</app:wrapMode>\n"
    ]
    for polygon, rings in targets:
        coordinates = "".join(f'<app:textureCoordinates ring="#{polygon}_{j}">{text}</app:textureCoordinates>' for j, text in enumerate(rings))
        parts.append(f'<app:target uri="#{polygon}"><app:TexCoordList>{coordinates}</app:TexCoordList></app:target>\n')
    parts.append("</app:ParameterizedTexture></app:surfaceDataMember>\n")
    return "".join(parts)


def format_material(name: str, ids: list[str]) -> str:
    """Formats a plain material with its targets."""
    color = format_numbers(DIFFUSE_COLORS[name], 3)
    targets = "\n".join(f"<app:target>#{polygon}</app:target>" for polygon in ids)
    return (
        f"<app:surfaceDataMember><app:X3DMaterial><gml:name>{name}</gml:name><app:diffuseColor>{color}</app:diffuseColor>"
        f"{targets}</app:X3DMaterial></app:surfaceDataMember>\n"
    )


def format_ring(ring: Points, decimals: int, closed: bool = True) -> str:
    """Formats the coordinates of a ring; `closed` repeats the first point."""
    values = ring.ravel().tolist()
    return format_numbers(values + values[: ring.shape[1]] if closed else values, decimals)


class BuildingWriter:
    """Writes buildings; `crs_offset` converts town coordinates to the CRS."""

    def __init__(self, out: TextIO, crs_offset: Points, shared: SharedAppearance) -> None:
        self.out, self.crs_offset, self.shared = out, crs_offset, shared
        self.atlas: TextureAtlas | None = None
        self.atlas_uri = ""
        self.targets: list[tuple[str, list[str]]] = []
        self.serial = 0
        self.building_id = ""

    def write(self, model: BuildingModel, atlas: TextureAtlas | None, atlas_uri: str, attributes: BuildingAttributes) -> None:
        """Writes a building with its appearance; several bodies become building parts."""
        self.atlas, self.atlas_uri, self.targets, self.serial = atlas, atlas_uri, [], 0
        self.building_id = attributes.id
        several = len(model.bodies) > 1
        inner = [self._format_part(body, model, part) for part, body in enumerate(model.bodies)]
        out = self.out
        out.write(f'<core:cityObjectMember><bldg:Building gml:id="{attributes.id}"><gml:name>{escape(attributes.name)}</gml:name>\n')
        out.write("".join(_format_generic(attributes)))
        out.write(self._format_appearance())
        out.write(_format_properties(attributes))
        if several:
            for number, text in enumerate(inner):
                part = model.plan.parts[number]
                out.write(f'<bldg:consistsOfBuildingPart><bldg:BuildingPart gml:id="{attributes.id}_part{number}">')
                out.write(f"<bldg:roofType>{part.roof_type}</bldg:roofType>{text}</bldg:BuildingPart></bldg:consistsOfBuildingPart>\n")
        else:
            out.write(f"<bldg:roofType>{model.plan.parts[0].roof_type}</bldg:roofType>{_format_heights(attributes)}{inner[0]}")
        out.write(f"{_format_address(attributes)}</bldg:Building></core:cityObjectMember>\n")

    def _format_appearance(self) -> str:
        """Formats the appearance of the current building: its targets in the atlas."""
        if not self.targets:
            return ""
        body = format_texture(self.atlas_uri, "image/jpeg", "none", self.targets)
        return f"<app:appearance><app:Appearance><app:theme>{THEME}</app:theme>{body}</app:Appearance></app:appearance>\n"

    def _format_part(self, body: PartGeometry, model: BuildingModel, part: int) -> str:
        """Formats geometry, installations and boundary surfaces in the order of the schema."""
        if model.plan.kind == "shed":
            return self._format_shed(body)
        lod = 3 if model.deep else 2
        shell_ids: list[str] = []
        bounded = "".join(self._format_boundary(s, lod, shell_ids) for s in body.shell)
        bounded += "".join(self._format_boundary(s, lod, None) for s in body.overhangs)
        fitted = "".join(self._format_installation(f, surfaces, lod) for f, surfaces in body.installations)
        members = "".join(f'<gml:surfaceMember xlink:href="#{i}"/>' for i in shell_ids)
        solid = (model.plan.number + part) % 4 != 3
        kind, geometry = ("Solid", _format_solid(members)) if solid else ("MultiSurface", f"<gml:MultiSurface>{members}</gml:MultiSurface>")
        whole = f"<bldg:lod{lod}{kind}>{geometry}</bldg:lod{lod}{kind}>\n"
        if lod == 3:
            return f"{self._format_lod1(body)}{fitted}{bounded}{whole}"
        return f"{whole}{fitted}{bounded}"

    def _format_shed(self, body: PartGeometry) -> str:
        """Formats a shed: a solid with inline polygons, without boundary surfaces."""
        members = "".join(f"<gml:surfaceMember>{self._format_polygon(face)}</gml:surfaceMember>" for s in body.shell for face in s.faces)
        return f"<bldg:lod2Solid>{_format_solid(members)}</bldg:lod2Solid>\n"

    def _format_lod1(self, body: PartGeometry) -> str:
        """Formats the LoD1 solid of an LoD3 building: its extruded ground polygon."""
        rings = body.shell[-1].faces[0].rings
        top = float(max(f.rings[0][:, 2].max() for s in body.shell if s.kind == ROOF for f in s.faces)) if body.shell else 0.0
        faces = [TexturedFace(rings, rings, PlainMaterial("block"))]
        lifted = [np.column_stack([r[:, :2], np.full(len(r), top)]) for r in rings]
        faces.append(TexturedFace([r[::-1] for r in lifted], rings, PlainMaterial("block")))
        for ring, upper in zip(rings, lifted, strict=True):
            for i in range(len(ring)):
                j = (i + 1) % len(ring)
                quad = np.array([ring[j], ring[i], upper[i], upper[j]])
                faces.append(TexturedFace([quad], [quad[:, :2]], PlainMaterial("block")))
        members = "".join(f"<gml:surfaceMember>{self._format_polygon(face)}</gml:surfaceMember>" for face in faces)
        return f"<bldg:lod1Solid>{_format_solid(members)}</bldg:lod1Solid>\n"

    def _format_boundary(self, surface: BoundarySurface, lod: int, shell_ids: list[str] | None) -> str:
        """Formats a boundary surface with its openings; adds its polygon ids to `shell_ids`."""
        first = self.serial
        polygons = "".join(f"<gml:surfaceMember>{self._format_polygon(face)}</gml:surfaceMember>" for face in surface.faces)
        ids = [f"{self.building_id}_p{i}" for i in range(first, self.serial)]
        openings = []
        for opening in surface.openings:
            ids.append(f"{self.building_id}_p{self.serial}")
            inner = self._format_polygon(opening.faces[0])
            openings.append(
                f'<bldg:opening><bldg:{opening.kind} gml:id="{ids[-1]}_o"><bldg:lod3MultiSurface><gml:MultiSurface><gml:surfaceMember>'
                f"{inner}</gml:surfaceMember></gml:MultiSurface></bldg:lod3MultiSurface></bldg:{opening.kind}></bldg:opening>"
            )
        if shell_ids is not None:
            shell_ids += ids
        return (
            f'<bldg:boundedBy><bldg:{surface.kind} gml:id="{self.building_id}_s{first}"><bldg:lod{lod}MultiSurface><gml:MultiSurface>'
            f"{polygons}</gml:MultiSurface></bldg:lod{lod}MultiSurface>{''.join(openings)}</bldg:{surface.kind}></bldg:boundedBy>\n"
        )

    def _format_installation(self, function: str, surfaces: list[BoundarySurface], lod: int) -> str:
        """Formats a building installation."""
        first = self.serial
        members = "".join(f"<gml:surfaceMember>{self._format_polygon(face)}</gml:surfaceMember>" for s in surfaces for face in s.faces)
        return (
            f'<bldg:outerBuildingInstallation><bldg:BuildingInstallation gml:id="{self.building_id}_i{first}">'
            f"<bldg:function>{function}</bldg:function><bldg:lod{lod}Geometry><gml:MultiSurface>{members}</gml:MultiSurface>"
            f"</bldg:lod{lod}Geometry></bldg:BuildingInstallation></bldg:outerBuildingInstallation>\n"
        )

    def _format_polygon(self, face: TexturedFace) -> str:
        """Formats a polygon with a new id, and adds it to the targets of its material."""
        name = f"{self.building_id}_p{self.serial}"
        self.serial += 1
        self._add_target(name, face)
        rings = []
        for j, ring in enumerate(face.rings):
            place = "exterior" if j == 0 else "interior"
            text = format_ring(ring + self.crs_offset, 4)
            rings.append(
                f'<gml:{place}><gml:LinearRing gml:id="{name}_{j}"><gml:posList srsDimension="3">{text}</gml:posList></gml:LinearRing></gml:{place}>'
            )
        return f'<gml:Polygon gml:id="{name}">{"".join(rings)}</gml:Polygon>'

    def _add_target(self, name: str, face: TexturedFace) -> None:
        """Adds the polygon to the targets of its material."""
        if isinstance(face.material, AtlasTexture):
            assert self.atlas is not None
            self.targets.append((name, [format_ring(uv, 6) for uv in self.atlas.uv(face)]))
        elif isinstance(face.material, RepeatingTexture):
            size = face.material.size_m
            self.shared.repeating[face.material].append((name, [format_ring(st / size, 5) for st in face.st]))
        else:
            self.shared.plain[face.material.name].append(name)


def _format_solid(members: str) -> str:
    return f"<gml:Solid><gml:exterior><gml:CompositeSurface>{members}</gml:CompositeSurface></gml:exterior></gml:Solid>"


def _format_generic(attributes: BuildingAttributes) -> Iterator[str]:
    for kind, name, value in attributes.generic:
        yield f'<gen:{kind}Attribute name="{name}"><gen:value>{escape(value)}</gen:value></gen:{kind}Attribute>\n'


def _format_properties(attributes: BuildingAttributes) -> str:
    function = f"<bldg:function>{attributes.function}</bldg:function>" if attributes.function else ""
    return f"{function}<bldg:yearOfConstruction>{attributes.year:04d}</bldg:yearOfConstruction>"


def _format_heights(attributes: BuildingAttributes) -> str:
    return (
        f'<bldg:measuredHeight uom="m">{attributes.height_m:.2f}</bldg:measuredHeight>'
        f"<bldg:storeysAboveGround>{attributes.storeys}</bldg:storeysAboveGround>\n"
    )


def _format_address(attributes: BuildingAttributes) -> str:
    if not attributes.street:
        return ""
    return (
        "<bldg:address><core:Address><core:xalAddress><xAL:AddressDetails><xAL:Country>"
        f'<xAL:CountryName>{escape(attributes.country)}</xAL:CountryName><xAL:Locality Type="Town">'
        f'<xAL:LocalityName>{escape(attributes.town)}</xAL:LocalityName><xAL:Thoroughfare Type="Street">'
        f"<xAL:ThoroughfareNumber>{attributes.house_number}</xAL:ThoroughfareNumber>"
        f"<xAL:ThoroughfareName>{escape(attributes.street)}</xAL:ThoroughfareName></xAL:Thoroughfare></xAL:Locality>"
        "</xAL:Country></xAL:AddressDetails></core:xalAddress></core:Address></bldg:address>\n"
    )
