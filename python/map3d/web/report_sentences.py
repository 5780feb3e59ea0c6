"""What import reports name, as sentences of pages: reason → text, translated where it is shown."""

from collections.abc import Mapping
from typing import Final

N_: Final = str
"""Marks a text that is translated where it is shown."""

IMAGE_FAULTS: Final[Mapping[str, str]] = {
    "image: file not found": N_("Textures not found: {count}. Upload them together with the model."),
    "image: unknown format": N_("Textures in a format that map3d does not read: {count}."),
    "image: file outside the asset's folder not read": N_("Textures outside the given folder, which are not read: {count}."),
    "image: URL not fetched": N_("Textures on the web, which are not fetched: {count}."),
    "image: not a regular file": N_("Textures whose name leads to something that is not a file: {count}."),
    "image: invalid file name": N_("Textures with an invalid file name: {count}."),
    "image: unsupported format": N_("Textures in an image format that map3d does not read: {count}."),
    "image: invalid header": N_("Textures with a damaged header: {count}."),
    "image: no pixels": N_("Textures without pixels: {count}."),
    "unusable image": N_("Materials without a usable texture, shown in their colour: {count}."),
    "georeferenced texture without reference point or world file": N_("Georeferenced textures without a reference point or world file: {count}."),
    "georeferenced texture in another coordinate system than the surface, not used": N_(
        "Georeferenced textures in another coordinate system than their surfaces, not used: {count}."
    ),
}
FAULTS: Final[Mapping[str, str]] = {
    **IMAGE_FAULTS,
    "polygon with crossing rings": N_("Polygons whose rings cross, which may look wrong: {count}."),
    "ring that is not closed": N_("Rings that are not closed: {count}."),
    "unresolved reference": N_("References that lead nowhere in the file: {count}."),
    "part of an object in another file, not followed": N_("Parts of objects that are in other files, which are not read: {count}."),
    "reference into another file: file not found": N_("References to other files that are not there: {count}."),
    "reference into another file: file outside the given folder not read": N_(
        "References to files outside the given folder, which are not read: {count}."
    ),
    "reference into another file: URL not fetched": N_("References to files on the web, which are not fetched: {count}."),
    "reference into another file: not a regular file": N_("References to something that is not a file: {count}."),
    "reference into another file: invalid file name": N_("References to other files with an invalid name: {count}."),
    "reference into another file: no geometry with this id": N_("References to geometry that the other file does not have: {count}."),
    "reference into another file: chain of more than 16 references": N_(
        "References at the end of a chain of more than 16, which were not followed: {count}."
    ),
    "reference into another file: more than 1 GiB of other files": N_(
        "References not followed, since more than 1 GiB of other files would be read: {count}."
    ),
    "reference into another file: too many references": N_("References to other files beyond the limit, which were not followed: {count}."),
    "another file that this one refers to is broken or too large; what was read of it is kept": N_(
        "Other files that this one refers to are broken or too large; what was read of them is kept: {count}."
    ),
    "appearance in another file: no surface with this id": N_("Appearances in other files for surfaces that this file does not have: {count}."),
    "appearance for surfaces of another file, used where both are imported together": N_(
        "Appearances for surfaces of other files; they are used where both files are imported together: {count}."
    ),
    "parts in another coordinate system than the rest of the file, transformed": N_(
        "Triangles and placements in another coordinate system than the rest of the file, transformed: {count}."
    ),
    "the file names more than one coordinate system; all parts are read in the one given": N_(
        "Coordinate systems that the file names, all read as the one given: {count}."
    ),
    "material not defined": N_("Materials that are used but not defined: {count}."),
    "Tin: maxLength that is not a length": N_("TINs whose limit for the sides of triangles is not a length; all triangles are kept: {count}."),
    "Tin: points in one place with different heights": N_("TINs with points in one place that differ in height; the first is used: {count}."),
    "unknown wrap mode": N_("Textures with an unknown wrap mode: {count}."),
    "tiles outside the photo": N_("Parts of the terrain outside the orthophoto or without data in it, in a plain colour: {count}."),
    "heights beyond ±100 km count as gaps": N_("Heights beyond ±100 km, read as gaps: {count}."),
    "unknown height unit, assumed metres": N_("Elevation models in an unknown unit of height, read as metres: {count}."),
    "raster without CRS, assumed the scene's": N_("Rasters without a coordinate system, read in that of the scene: {count}."),
    "raster without CRS, read as local metres": N_("Rasters without a coordinate system, read as local metres: {count}."),
    "raster's CRS not used, because the scene is in local metres": N_(
        "Rasters whose coordinate system is not used, since the scene is in local metres: {count}."
    ),
    "raster far from the scene's content": N_("Rasters far from the rest of the scene: {count}."),
    "raster left out, far from the others": N_("Rasters far from the others, left out: {count}."),
    "raster skipped": N_("Rasters that cannot be read, left out: {count}."),
    "rasters of different resolution": N_("Mosaics of rasters of different resolutions: {count}."),
    "library object: file not found": N_("Files with shared shapes, such as trees, that are not there: {count}."),
    "library object: file outside the asset's folder not read": N_("Files with shared shapes outside the given folder, which are not read: {count}."),
    "library object: URL not fetched": N_("Shared shapes on the web, which are not fetched: {count}."),
    "library object: not a regular file": N_("Shared shapes whose name leads to something that is not a file: {count}."),
    "library object: invalid file name": N_("Shared shapes with an invalid file name: {count}."),
    "library object: unsupported format": N_("Files with shared shapes that are not OBJ files, which map3d does not read: {count}."),
    "material library: file not found": N_("Material libraries (.mtl) not found: {count}. Upload them together with the model."),
    "material library: file outside the asset's folder not read": N_("Material libraries outside the given folder, which are not read: {count}."),
    "material library: URL not fetched": N_("Material libraries on the web, which are not fetched: {count}."),
    "material library: not a regular file": N_("Material libraries whose name leads to something that is not a file: {count}."),
    "material library: invalid file name": N_("Material libraries with an invalid file name: {count}."),
    "mtllib without a file name": N_("Statements that name a material library without a file name: {count}."),
    "material defined more than once; using the first": N_("Materials that are defined more than once; the first definition is used: {count}."),
    "map_d without map_Kd ignored": N_("Materials with an alpha map but no texture, drawn without the alpha map: {count}."),
    "black Kd with map_Kd treated as white": N_("Materials with a texture and the colour black, drawn as white so that the texture shows: {count}."),
    "texture index out of range: face without texture": N_("Faces that refer to missing texture coordinates, drawn without a texture: {count}."),
    "normal index out of range: face without normals": N_("Faces that refer to missing normals, which are computed instead: {count}."),
    "self-intersecting face": N_("Faces whose edges cross, which may look wrong: {count}."),
    "the model seems to lie on its side": N_(
        "Models that seem to lie on their side: {count}. Choose “y” as the axis that points up if they should stand."
    ),
    "backslashes in a file name": N_("Names of files with backslashes, read as slashes: {count}."),
    "percent-encoded file name": N_("Names of files that are encoded as in web addresses, read decoded: {count}."),
    "file name with different case": N_("Names of files found in other upper and lower case: {count}."),
    "transparency read as opacity": N_("Files whose transparency is read as opacity, since all would be invisible otherwise: {count}."),
    "fully transparent surfaces are not drawn": N_("Files with fully transparent surfaces, which are not drawn: {count}."),
    "polygons of interiors are not drawn": N_("Files with rooms, which are not drawn: {count}. The option “CityGML: rooms” draws them."),
    "document broken": N_("Files that break off; what comes before is kept: {count}."),
    "unknown encoding, read as UTF-8": N_("Files in an unknown encoding of text, read as UTF-8: {count}."),
    "not UTF-8 as declared; other bytes read as Windows-1252": N_(
        "Files that are not in UTF-8 as they claim; other bytes are read as Windows-1252: {count}."
    ),
    "zero bytes left out": N_("Files with zero bytes in their text, which are left out: {count}."),
    "gzip file cut or damaged": N_("Packed files that are cut off or damaged; what could be unpacked is kept: {count}."),
    "nothing at the requested level of detail": N_("Files with nothing at the chosen level of detail: {count}."),
    "appearance theme used": N_("Files with several themes of appearances, of which one is used: {count}."),
    "requested appearance theme is not in the file": N_("Files without the chosen theme of appearances: {count}."),
    "appearance of another theme ignored": N_("Appearances of other themes, not used: {count}."),
    "appearance of back sides used only for surfaces without one of the front": N_(
        "Appearances of back sides, used only for surfaces without one of the front: {count}."
    ),
    "unsupported surface data": N_("Appearances of kinds that map3d does not read: {count}."),
    "texture without a parameterization": N_("Polygons with a texture but no place in it: {count}."),
    "texture without coordinates for an interior ring": N_("Polygons whose holes have no texture coordinates, drawn without the texture: {count}."),
    "fewer texture coordinates than points": N_("Polygons with fewer texture coordinates than points, drawn without the texture: {count}."),
    "unknown texture parameterization": N_("Textures placed in a way that map3d does not read: {count}."),
    "unreadable texture coordinates": N_("Lists of texture coordinates that are unreadable: {count}."),
    "unreadable worldToTexture matrix": N_("Textures with an unreadable projection matrix: {count}."),
    "unsupported geometry element": N_("Geometry elements that map3d does not read, left out: {count}."),
    "unknown element; features inside it are read": N_("Elements that map3d does not know; what is inside them is read: {count}."),
    "geometry without a level of detail read as level 0": N_("Geometry without a level of detail, read as level 0: {count}."),
    "code list not read; its codes are kept as they are": N_("Code lists that are missing or unreadable; their codes stay as they are: {count}."),
    "axes swapped, so the file is read as northing, easting": N_("Files with swapped axes, read as northing, easting: {count}."),
    "axes swapped, so the file is read as longitude, latitude": N_("Files with swapped axes, read as longitude, latitude: {count}."),
    "axes swapped, so the file is read as latitude, longitude": N_("Files with swapped axes, read as latitude, longitude: {count}."),
    "georeferenced texture in another coordinate system that no affine map reaches within half a pixel, not used": N_(
        "Georeferenced textures in another coordinate system, which would be more than half a pixel out of place and are not used: {count}."
    ),
    "RasterRelief: grid in another place, not followed": N_("References to grids of heights in other places, not followed: {count}."),
    "RasterRelief: extent not applied to its raster": N_(
        "Rasters of heights whose extent in the model is not applied; they are read as a whole: {count}."
    ),
    "RasterRelief: raster read as terrain": N_("Rasters of heights that the model names, read as terrain: {count}."),
    "RasterRelief: raster in another place than its grid, read in its own": N_(
        "Rasters of heights that lie elsewhere than the model says, read where they say themselves: {count}."
    ),
}
FAULTS_BY_LIMIT: Final[Mapping[str, str]] = {
    "image: side over the limit max_image_side_px": N_("Textures with a side of more than {limit} pixels: {count}."),
    "image: pixels over the limit max_image_px": N_("Textures of more than {limit} pixels: {count}."),
}
"""Reasons that end with ` = ` and the limit."""
FAULTS_BY_NAME: Final[Mapping[str, str]] = {
    "image: unreadable": N_("Textures that cannot be read {name}: {count}."),
    "points outside the area of use of": N_("Points outside the area that the coordinate system {name} is meant for: {count}."),
    "corners of the raster outside the area of use of": N_(
        "Corners of rasters outside the area that the coordinate system {name} is meant for: {count}."
    ),
}
"""Reasons that end with a name or words in brackets."""
SKIPPED: Final[Mapping[str, str]] = {
    "coordinate is not a finite number": N_("Skipped polygons and triangles with coordinates that are not finite numbers: {count}."),
    "coordinate too far from the origin": N_("Skipped triangles too far from the origin: {count}."),
    "face with fewer than 3 vertices": N_("Skipped faces with fewer than 3 vertices: {count}."),
    "free-form curve or surface": N_("Skipped free-form curves and surfaces: {count}."),
    "fully transparent face": N_("Fully transparent faces, left out: {count}."),
    "fully transparent polygon": N_("Fully transparent polygons, left out: {count}."),
    "geometry that refers to itself": N_("Skipped geometry that refers to itself: {count}."),
    "grid points without a height": N_("Grid points without a height, left out: {count}."),
    "implicit geometry in one of too many coordinate systems": N_("Skipped implicit geometry in one of too many coordinate systems: {count}."),
    "implicit geometry with an invalid transformation matrix": N_("Skipped implicit geometry with an invalid transformation matrix: {count}."),
    "implicit geometry without a prototype": N_("Skipped implicit geometry without a prototype: {count}."),
    "implicit geometry without a reference point": N_("Skipped implicit geometry without a reference point: {count}."),
    "implicit geometry without a place in the scene's coordinate system": N_(
        "Skipped implicit geometry without a place in the coordinate system of the scene: {count}."
    ),
    "index out of range": N_("Skipped triangles and faces that refer to missing vertices: {count}."),
    "points and lines": N_("Points and lines, left out: {count}."),
    "polygon in more than one coordinate system": N_("Skipped polygons in more than one coordinate system: {count}."),
    "polygon in one of too many coordinate systems": N_("Skipped polygons in one of too many coordinate systems: {count}."),
    "polygon of an interior": N_("Polygons of rooms, left out: {count}. The option “CityGML: rooms” draws them."),
    "polygon that could not be triangulated": N_("Skipped polygons that could not be divided into triangles: {count}."),
    "polygon with too many vertices to triangulate": N_(
        "Skipped polygons with too many vertices and crossing edges to be divided into triangles: {count}."
    ),
    "polygon with unreadable coordinates": N_("Skipped polygons with unreadable coordinates: {count}."),
    "polygon without area": N_("Skipped polygons without area: {count}."),
    "polygon without rings": N_("Skipped polygons without rings: {count}."),
    "ring with fewer than 3 points": N_("Skipped rings with fewer than 3 points: {count}."),
    "solid of an open space": N_("Solids of open spaces, left out: {count}."),
    "texture coordinate is not a finite number": N_("Texture coordinates that are not finite numbers, left out: {count}."),
    "Tin: break line that crosses another one": N_("Pieces of break lines of TINs that cross another break line, left out: {count}."),
    "Tin: control points on a line": N_("Skipped TINs whose control points are on one line: {count}."),
    "Tin: could not be triangulated": N_("Skipped TINs that could not be divided into triangles: {count}."),
    "Tin: fewer than 3 control points": N_("Skipped TINs with fewer than 3 control points: {count}."),
    "Tin: point whose coordinates are not finite numbers": N_("Points of TINs with coordinates that are not finite numbers, left out: {count}."),
    "Tin: points in more than one coordinate system": N_("Skipped TINs with points in more than one coordinate system: {count}."),
    "Tin: points in one of too many coordinate systems": N_("Skipped TINs in one of too many coordinate systems: {count}."),
    "Tin: too many points or crossing lines": N_("Skipped TINs with too many points or crossing lines: {count}."),
    "Tin: triangle at a stop line": N_("Triangles of TINs at stop lines, left out: {count}."),
    "Tin: triangle with a side over maxLength": N_("Triangles of TINs with a side over the longest that the file allows, left out: {count}."),
    "Tin: unreadable coordinates": N_("Skipped TINs with unreadable coordinates: {count}."),
    "unreadable face": N_("Skipped unreadable faces: {count}."),
    "unreadable vertex": N_("Skipped unreadable vertices: {count}."),
    "unsupported geometry type": N_("Geometry of types that map3d does not read, left out: {count}."),
    "zero area": N_("Triangles without area, left out: {count}."),
    "RasterRelief: grid without heights": N_("Skipped grids of heights without heights: {count}."),
    "RasterRelief: grid without a place in the world": N_("Skipped grids of heights without a place in the world: {count}."),
    "RasterRelief: grid without limits, origin or two offset vectors": N_(
        "Skipped grids of heights without limits, origin or two offset vectors: {count}."
    ),
    "RasterRelief: grid with fewer than 2 × 2 points": N_("Skipped grids of heights with fewer than 2 points in a direction: {count}."),
    "RasterRelief: order of values that map3d does not read": N_("Skipped grids of heights in an order that map3d does not read: {count}."),
    "RasterRelief: offset vectors that span no area": N_("Skipped grids of heights whose points lie on a line: {count}."),
    "RasterRelief: grid in one of too many coordinate systems": N_("Skipped grids of heights in one of too many coordinate systems: {count}."),
    "RasterRelief: number of heights that does not fit the grid": N_("Skipped grids with more or fewer heights than points: {count}."),
    "RasterRelief: too many heights in the document": N_(
        "Skipped grids with too many heights in the file itself: {count}. A raster file may have more."
    ),
    "RasterRelief: triangle outside the extent": N_("Triangles of grids of heights outside their extent, left out: {count}."),
    "RasterRelief: file not found": N_("Rasters of heights not found: {count}. Upload them together with the model."),
    "RasterRelief: file outside the asset's folder not read": N_("Rasters of heights outside the given folder, which are not read: {count}."),
    "RasterRelief: URL not fetched": N_("Rasters of heights on the web, which are not fetched: {count}."),
    "RasterRelief: not a regular file": N_("Rasters of heights whose name leads to something that is not a file: {count}."),
    "RasterRelief: invalid file name": N_("Rasters of heights with an invalid file name: {count}."),
}
"""What is not in the map: skipped since it is broken, or left out by design."""
SKIPPED_BY_LIMIT: Final[Mapping[str, str]] = {
    "face over the limit max_ring_vertices": N_("Skipped faces with more than {limit} vertices: {count}."),
    "ring over the limit max_ring_vertices": N_("Skipped rings with more than {limit} points: {count}."),
}
"""Reasons that end with ` = ` and the limit."""
SKIPPED_BY_NAME: Final[Mapping[str, str]] = {
    "part in an unusable coordinate system": N_("Skipped triangles and placements in the coordinate system {name}, which is not usable: {count}."),
}
"""Reasons that end with ` = ` and a name of the file."""


Sentence = tuple[str, dict[str, int | str]]
"""A text, and its values besides the count."""


def fault_sentence(reason: str) -> Sentence | None:
    """Returns the sentence of a warning; None for an unknown reason."""
    if reason in FAULTS:
        return FAULTS[reason], {}
    for start, text in FAULTS_BY_NAME.items():
        if reason.startswith(f"{start} "):
            return text, {"name": reason.removeprefix(f"{start} ")}
    return _limited(reason, FAULTS_BY_LIMIT)


def skip_sentence(reason: str) -> Sentence | None:
    """Returns the sentence of something that is not in the map; None for an unknown reason."""
    if reason in SKIPPED:
        return SKIPPED[reason], {}
    start, _equals, name = reason.partition(" = ")
    return (SKIPPED_BY_NAME[start], {"name": name}) if start in SKIPPED_BY_NAME else _limited(reason, SKIPPED_BY_LIMIT)


def _limited(reason: str, texts: Mapping[str, str]) -> Sentence | None:
    start, _equals, limit = reason.partition(" = ")
    return (texts[start], {"limit": int(limit)}) if start in texts and limit.isdecimal() else None
