"""The jobs that produce a town: orthophoto, elevation, shared files, buildings with their atlases, trees."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from map3d_town.layout.town_plan import BuildingPlan, PlannedTree, TownPlan
from map3d_town.models.building_attributes import describe_building
from map3d_town.models.building_geometry import build_model
from map3d_town.models.building_model import AtlasTexture, BuildingModel
from map3d_town.output_folder import TownFolder
from map3d_town.polygons_2d import Points
from map3d_town.textures.shared_materials import REPEATING_TEXTURES, draw_repeating_texture
from map3d_town.textures.texture_atlas import TextureAtlas, draw_atlas, encode_jpeg, encode_png, pack_atlas
from map3d_town.textures.tree_textures import draw_leaf_texture
from map3d_town.town_spec import TownSpec
from map3d_town.writers.citygml_writer import BuildingWriter, SharedAppearance, write_foot, write_head
from map3d_town.writers.ground_rasters import write_dem, write_ortho
from map3d_town.writers.obj_writer import mtl_text, obj_text
from map3d_town.writers.tree_writer import TreeWriter

TREES_PER_FILE = 20_000


@dataclass(frozen=True)
class ProductionJob:
    """A job that writes some files.

    `kind`: "buildings", "trees", "ortho", "dem" or "shared"; `number`: of the CityGML file; `plan`: the part of the town's plan that the job
    needs, so that no worker has to hold all of it.
    """

    kind: str
    number: int
    plan: TownPlan


@dataclass(frozen=True)
class JobFiles:
    """The files of a finished job by name, with their sizes: those that it wrote, and those that were complete already. `kind`: that of the job."""

    kind: str
    written: dict[str, int]
    kept: dict[str, int]


def list_jobs(town: TownFolder) -> Iterator[ProductionJob]:
    """Yields all jobs of a town, the longest first."""
    spec, plan = town.spec, town.plan
    none = TownPlan(radius_m=plan.radius_m)
    if spec.terrain:
        yield ProductionJob("ortho", 0, replace(none, patches=plan.patches, trees=plan.trees))
        yield ProductionJob("dem", 0, none)
    species = {tree.species: tree for tree in plan.trees}.values()
    yield ProductionJob("shared", 0, replace(none, buildings=plan.buildings if "obj" in spec.formats else [], trees=list(species)))
    for number in range(spec.files):
        yield ProductionJob("buildings", number, replace(none, buildings=buildings_of_file(plan, spec, number)))
    if spec.trees and "citygml" in spec.formats:
        for number, first in enumerate(range(0, len(plan.trees), TREES_PER_FILE)):
            yield ProductionJob("trees", number, replace(none, trees=plan.trees[first : first + TREES_PER_FILE]))


def run_job(town: TownFolder, job: ProductionJob) -> JobFiles:
    town.written, town.kept = {}, {}
    match job.kind:
        case "ortho":
            _write_orthophoto(town, job.plan)
        case "dem":
            _write_elevation(town, job.plan)
        case "shared":
            _write_shared_files(town, job.plan)
        case "buildings":
            _write_buildings(town, job.number, job.plan.buildings)
        case "trees":
            _write_trees(town, job.number, job.plan.trees)
    return JobFiles(job.kind, town.written, town.kept)


def _write_orthophoto(town: TownFolder, plan: TownPlan) -> None:
    spec, (px_m, side_px) = town.spec, orthophoto_size(town.spec, plan)
    if town.needs("terrain/ortho.tif"):
        with town.open_pending("terrain/ortho.tif") as pending:
            write_ortho(pending.path, plan, px_m, side_px, spec.projected_epsg, spec.east_m, spec.north_m, town.raise_if_interrupted)


def orthophoto_size(spec: TownSpec, plan: TownPlan) -> tuple[float, int]:
    """Returns (pixel size in metres, side in pixels)."""
    side_m = 2 * plan.radius_m
    side_px = int(np.ceil(side_m / spec.ortho_pixel_m(side_m)))
    return side_m / side_px, side_px


def _write_elevation(town: TownFolder, plan: TownPlan) -> None:
    spec = town.spec
    if town.needs("terrain/dem.tif"):
        with town.open_pending("terrain/dem.tif") as pending:
            pixel = spec.dem_pixel_m(2 * plan.radius_m)
            write_dem(pending.path, town.ground, plan.radius_m, pixel, spec.crs, spec.east_m, spec.north_m)


def _write_shared_files(town: TownFolder, plan: TownPlan) -> None:
    """Writes the repeating textures, the leaf textures and the MTL file."""
    for folder in town.spec.formats:
        for name in REPEATING_TEXTURES:
            if town.needs(f"{folder}/textures/{name}.jpg"):
                town.write(f"{folder}/textures/{name}.jpg", encode_jpeg(draw_repeating_texture(name)))
    if "citygml" in town.spec.formats and town.spec.trees:
        for species in sorted({tree.species for tree in plan.trees}):
            for view in ("side", "top"):
                name = f"citygml/textures/{species}_{view}.png"
                if town.needs(name):
                    town.write(name, encode_png(draw_leaf_texture(f"{species}_{view}")))
    if "obj" in town.spec.formats and town.needs("obj/town.mtl"):
        names = [atlas_name(file, group) for file in range(town.spec.files) for group, _ in enumerate(atlas_groups(plan, town.spec, file))]
        town.write("obj/town.mtl", mtl_text(names).encode())


def atlas_name(file: int, group: int) -> str:
    return f"a{file:03d}_{group:05d}"


def buildings_of_file(plan: TownPlan, spec: TownSpec, file: int) -> list[BuildingPlan]:
    """Returns the buildings of a CityGML file of the whole plan, neighbours in the order of the plan."""
    buildings, files = plan.buildings, spec.files
    return buildings[len(buildings) * file // files : len(buildings) * (file + 1) // files]


def atlas_groups(plan: TownPlan, spec: TownSpec, file: int) -> list[list[BuildingPlan]]:
    """Splits the buildings of a file of the whole plan into groups that share an atlas."""
    return split_by_atlas(buildings_of_file(plan, spec, file), spec, file)


def split_by_atlas(buildings: list[BuildingPlan], spec: TownSpec, file: int) -> list[list[BuildingPlan]]:
    """Splits the buildings of a file into groups that share an atlas."""
    count = spec.texture_count * (file + 1) // spec.files - spec.texture_count * file // spec.files
    count = max(1, min(count, len(buildings)))
    return [buildings[len(buildings) * g // count : len(buildings) * (g + 1) // count] for g in range(count)]


def _write_buildings(town: TownFolder, file: int, buildings: list[BuildingPlan]) -> None:
    """Writes a CityGML file of these buildings with its atlases, and the buildings as OBJ files."""
    spec = town.spec
    groups = split_by_atlas(buildings, spec, file)
    name = f"citygml/buildings_{file:03d}.gml"
    if "citygml" not in spec.formats or not town.needs(name):
        for number, group in enumerate(groups):
            _write_atlas_group(town, group, atlas_name(file, number), None)
        return
    with town.open_pending(name) as pending, pending.path.open("w", encoding="utf-8", newline="\n") as out:
        shared = SharedAppearance()
        writer = BuildingWriter(out, town.crs_offset, shared)
        low, high = _bounding_box(town, buildings)
        write_head(out, f"{spec.name} {file}", spec.srs_name, low, high, ("building", "appearance", "generics"))
        for number, group in enumerate(groups):
            _write_atlas_group(town, group, atlas_name(file, number), writer)
        write_foot(out, shared)


def _write_atlas_group(town: TownFolder, buildings: list[BuildingPlan], name: str, writer: BuildingWriter | None) -> None:
    """Writes the missing OBJ files and atlases of buildings that share an atlas, and with `writer` their CityGML."""
    town.raise_if_interrupted()
    spec = town.spec
    missing_objs = {building.number for building in buildings if "obj" in spec.formats and town.needs(f"obj/{obj_name(building)}.obj")}
    missing_atlases = [path for folder in spec.formats if town.needs(path := f"{folder}/textures/{name}.jpg")]
    if writer is None and not missing_objs and not missing_atlases:
        return
    models, atlas = build_atlas_group(town, buildings)
    if writer is not None:
        for model in models:
            writer.write(model, atlas, f"textures/{name}.jpg", describe_building(model, spec))
    for model in models:
        if model.plan.number in missing_objs:
            text = obj_text(model, obj_name(model.plan), atlas, name, town.crs_offset)
            town.write(f"obj/{obj_name(model.plan)}.obj", text.encode())
    if missing_atlases and atlas is not None:
        data = encode_jpeg(draw_atlas(atlas, buildings[0].number))
        for path in missing_atlases:
            town.write(path, data)


def build_atlas_group(town: TownFolder, buildings: list[BuildingPlan]) -> tuple[list[BuildingModel], TextureAtlas | None]:
    """Returns the models of buildings and their common atlas."""
    models = [build_model(building, town.spec.seed, town.ground, town.spec.deep_share) for building in buildings]
    return models, build_atlas(models, town.spec.atlas_px)


def obj_name(building: BuildingPlan) -> str:
    return f"b{building.number:06d}"


def build_atlas(models: Iterable[BuildingModel], side_px: int) -> TextureAtlas | None:
    """Packs the atlas textures of some buildings; returns None if there are none."""
    found: dict[int, AtlasTexture] = {}
    for model in models:
        for face in model.faces():
            if isinstance(face.material, AtlasTexture) and model.plan.kind != "shed":
                found.setdefault(id(face.material), face.material)
    return pack_atlas(list(found.values()), side_px) if found else None


def _bounding_box(town: TownFolder, buildings: list[BuildingPlan]) -> tuple[Points, Points]:
    """Returns the corners, in the CRS, of a box around some buildings and their eaves."""
    parts = [part for building in buildings for part in building.parts]
    plan = np.concatenate([part.footprint for part in parts])
    heights = town.ground.height(plan[:, 0], plan[:, 1])
    rise = max(part.eave_m + max(h for _, h in part.profile) for part in parts)
    low = np.array([*(plan.min(axis=0) - 2), heights.min() - 2])
    high = np.array([*(plan.max(axis=0) + 2), heights.max() + rise + 6])
    return low + town.crs_offset, high + town.crs_offset


def _write_trees(town: TownFolder, number: int, trees: list[PlannedTree]) -> None:
    name = f"citygml/trees_{number:03d}.gml"
    if not town.needs(name):
        return
    plan = np.array([(t.x, t.y) for t in trees])
    heights = town.ground.height(plan[:, 0], plan[:, 1])
    low = np.array([*(plan.min(axis=0) - 8), heights.min() - 1]) + town.crs_offset
    high = np.array([*(plan.max(axis=0) + 8), heights.max() + 30]) + town.crs_offset
    with town.open_pending(name) as pending, pending.path.open("w", encoding="utf-8", newline="\n") as out:
        shared = SharedAppearance()
        write_head(out, f"{town.spec.name}, trees {number}", town.spec.srs_name, low, high, ("vegetation", "appearance"))
        writer = TreeWriter(out, town.crs_offset, shared, f"t{number}_")
        for i, tree in enumerate(trees):
            if i % 1000 == 0:
                town.raise_if_interrupted()
            writer.write(tree, number * TREES_PER_FILE + i, float(heights[i]))
        writer.write_leaf_textures()
        write_foot(out, shared)
