"""The pieces of work that a town is made of: orthophoto, elevation, shared pictures, buildings with their atlases, trees."""

from collections.abc import Iterator
from dataclasses import dataclass
from io import StringIO

import numpy as np

from map3d_town import citygml, obj
from map3d_town.atlas import Atlas, atlas_picture, jpeg, pack, png
from map3d_town.describe import describe
from map3d_town.house import Built, build, footprint
from map3d_town.materials import WRAPS, wrap_picture
from map3d_town.model import Lot, Paint
from map3d_town.obj import all_faces
from map3d_town.raster import write_dem, write_ortho
from map3d_town.site import Site
from map3d_town.trees import TreeWriter, leaf_picture

TREES_PER_FILE = 20_000


@dataclass(frozen=True)
class Job:
    """A piece of work that makes some files: ("buildings" | "trees" | "ortho" | "dem" | "shared", number)."""

    kind: str
    number: int


def jobs_of(site: Site) -> Iterator[Job]:
    """All jobs of a town, the longest first."""
    if site.spec.terrain:
        yield Job("ortho", 0)
        yield Job("dem", 0)
    yield Job("shared", 0)
    for number in range(site.spec.files):
        yield Job("buildings", number)
    if site.spec.trees and "citygml" in site.spec.formats:
        for number in range(-(-len(site.plan.trees) // TREES_PER_FILE)):
            yield Job("trees", number)


def do(site: Site, job: Job) -> tuple[Job, dict[str, int], dict[str, int]]:
    """Does a job; returns the files it wrote and those that were complete already."""
    site.made, site.kept = {}, {}
    work = {"ortho": do_ortho, "dem": do_dem, "shared": do_shared, "buildings": do_buildings, "trees": do_trees}
    work[job.kind](site, job.number)
    return job, site.made, site.kept


def do_ortho(site: Site, number: int) -> None:
    spec, (px_m, side_px) = site.spec, ortho_size(site)
    if site.missing("terrain/ortho.tif"):
        with site.place("terrain/ortho.tif") as place:
            write_ortho(place.path, site.plan, px_m, side_px, spec.projected_epsg, spec.east_m, spec.north_m, site.check_going)


def ortho_size(site: Site) -> tuple[float, int]:
    """Metres of a pixel, and the orthophoto's side in pixels."""
    side_m = 2 * site.plan.radius_m
    side_px = int(np.ceil(side_m / site.spec.ortho_pixel_m(side_m)))
    return side_m / side_px, side_px


def do_dem(site: Site, number: int) -> None:
    spec = site.spec
    if site.missing("terrain/dem.tif"):
        with site.place("terrain/dem.tif") as place:
            pixel = spec.dem_pixel_m(2 * site.plan.radius_m)
            write_dem(place.path, site.ground, site.plan.radius_m, pixel, spec.crs, spec.east_m, spec.north_m)


def do_shared(site: Site, number: int) -> None:
    """Repeating textures, leaf textures, the MTL."""
    for folder in site.spec.formats:
        for name in WRAPS:
            if site.missing(f"{folder}/textures/{name}.jpg"):
                site.put(f"{folder}/textures/{name}.jpg", jpeg(wrap_picture(name)))
    if "citygml" in site.spec.formats and site.spec.trees:
        for species in sorted({tree.species for tree in site.plan.trees}):
            for view in ("side", "top"):
                name = f"citygml/textures/{species}_{view}.png"
                if site.missing(name):
                    site.put(name, png(leaf_picture(f"{species}_{view}")))
    if "obj" in site.spec.formats and site.missing("obj/town.mtl"):
        names = [atlas_name(f, g) for f in range(site.spec.files) for g, _ in enumerate(groups(site, f))]
        site.put("obj/town.mtl", obj.mtl_text(names).encode())


def atlas_name(file: int, group: int) -> str:
    return f"a{file:03d}_{group:05d}"


def lots_of(site: Site, file: int) -> list[Lot]:
    """The buildings of one file: neighbours, in the order of the plan."""
    lots, files = site.plan.lots, site.spec.files
    return lots[len(lots) * file // files : len(lots) * (file + 1) // files]


def groups(site: Site, file: int) -> list[list[Lot]]:
    """The buildings of a file by atlas; those without textures go with their neighbours."""
    lots, spec = lots_of(site, file), site.spec
    count = spec.texture_count * (file + 1) // spec.files - spec.texture_count * file // spec.files
    count = max(1, min(count, len(lots)))
    return [lots[len(lots) * g // count : len(lots) * (g + 1) // count] for g in range(count)]


def do_buildings(site: Site, file: int) -> None:
    """A CityGML file with its atlases, and the same buildings as OBJ files."""
    spec = site.spec
    name = f"citygml/buildings_{file:03d}.gml"
    looks, text = citygml.Looks(), StringIO()
    writing = "citygml" in spec.formats and site.missing(name)
    with_gml = citygml.BuildingWriter(text, site.shift, looks)
    if not writing:
        for group, lots in enumerate(groups(site, file)):
            do_group(site, lots, atlas_name(file, group), None)
        return
    with site.place(name) as place, place.path.open("w", encoding="utf-8", newline="\n") as out:
        with_gml.out = out
        low, high = box_of(site, lots_of(site, file))
        citygml.begin(out, f"{spec.name} {file}", spec.srs_name, low, high, ("building", "appearance", "generics"))
        for group, lots in enumerate(groups(site, file)):
            do_group(site, lots, atlas_name(file, group), with_gml)
        citygml.end(out, looks)


def do_group(site: Site, lots: list[Lot], name: str, writer: citygml.BuildingWriter | None) -> None:
    """The buildings that share an atlas; without `writer` only what else of them is missing."""
    site.check_going()
    spec = site.spec
    objs = [lot for lot in lots if "obj" in spec.formats and site.missing(f"obj/{obj_name(lot)}.obj")]
    pictures = [f"{folder}/textures/{name}.jpg" for folder in spec.formats]
    pictures = [picture for picture in pictures if site.missing(picture)]
    if writer is None and not objs and not pictures:
        return
    built = [build(lot, spec.seed, site.ground, spec.deep_share) for lot in lots]
    atlas = atlas_of(built, spec.atlas_px)
    if writer is not None:
        for each in built:
            writer.write(each, atlas, f"textures/{name}.jpg", describe(each, spec))
    for each in built:
        if each.lot in objs:
            site.put(f"obj/{obj_name(each.lot)}.obj", obj.obj_text(each, obj_name(each.lot), atlas, name, site.shift).encode())
    if pictures and atlas is not None:
        data = jpeg(atlas_picture(atlas, lots[0].number))
        for picture in pictures:
            site.put(picture, data)


def obj_name(lot: Lot) -> str:
    return f"b{lot.number:06d}"


def atlas_of(built: list[Built], side_px: int) -> Atlas | None:
    """An atlas for all paints of these buildings; None when they have none."""
    found: dict[int, Paint] = {}
    for each in built:
        for face in all_faces(each):
            if isinstance(face.paint, Paint) and each.lot.kind != "shed":
                found.setdefault(id(face.paint), face.paint)
    return pack(list(found.values()), side_px) if found else None


def box_of(site: Site, lots: list[Lot]) -> tuple[np.ndarray, np.ndarray]:
    """A box in CRS coordinates that holds these buildings with their eaves."""
    parts = [part for lot in lots for part in lot.parts]
    plan = np.concatenate([footprint(part) for part in parts])
    heights = site.ground.height(plan[:, 0], plan[:, 1])
    rise = max(part.eave_m + max(h for _, h in part.profile) for part in parts)
    low = np.array([*(plan.min(axis=0) - 2), heights.min() - 2])
    high = np.array([*(plan.max(axis=0) + 2), heights.max() + rise + 6])
    return low + site.shift, high + site.shift


def do_trees(site: Site, number: int) -> None:
    name = f"citygml/trees_{number:03d}.gml"
    if not site.missing(name):
        return
    first = number * TREES_PER_FILE
    trees = site.plan.trees[first : first + TREES_PER_FILE]
    plan = np.array([(t.x, t.y) for t in trees])
    heights = site.ground.height(plan[:, 0], plan[:, 1])
    low = np.array([*(plan.min(axis=0) - 8), heights.min() - 1]) + site.shift
    high = np.array([*(plan.max(axis=0) + 8), heights.max() + 30]) + site.shift
    with site.place(name) as place, place.path.open("w", encoding="utf-8", newline="\n") as out:
        looks = citygml.Looks()
        citygml.begin(out, f"{site.spec.name}, trees {number}", site.spec.srs_name, low, high, ("vegetation", "appearance"))
        writer = TreeWriter(out, site.shift, looks, f"t{number}_")
        for i, tree in enumerate(trees):
            if i % 1000 == 0:
                site.check_going()
            writer.write(tree, first + i, float(heights[i]))
        writer.appearance()
        citygml.end(out, looks)
