"""Small workspaces with synthetic tiles, for tests of serving and publishing."""

from io import BytesIO

from PIL import Image

from map3d.catalogue import RenderingRecord, SceneCrs, SceneRecord, Workspace
from map3d.geometry.frames import pin
from map3d.registry import NewObject, Registry
from map3d.tiles.block_versions import BlockVersions
from map3d.tiles.manifest import Manifest, ManifestCrs, ManifestView
from map3d.tiles.naming import block_levels, block_of
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoredTile, StoreShape
from map3d.types import BlockId, Layer, TileId, ViewAngles

BOX = ((-120.0, -80.0, 0.0), (130.0, 90.0, 22.5))
LAYERS = (Layer("color", "color", "webp", 80), Layer("normal", "normal", "png"), Layer("id", "id", "png"), Layer("depth", "depth", "png"))
ADDED = (Layer("again", "normal", "png"), Layer("coarse", "color", "jpeg", 40))
VIEWS = (ViewAngles(0, 45), ViewAngles(45, 22.5))
ZMAX = 4
OCCUPIED = {(0, 0), (1, 0), (2, 3), (7, 7), (15, 15), (8, 3)}
"""Base tiles with content; block 1/0/1 has none."""


OBJECTS = (
    NewObject("House <1>", "building", box=((0.0, 0.0, 0.0), (10.0, 20.0, 9.5)), attributes={"address": "Main Street 1", "height": 9.5}),
    NewObject("Roof", "roof", parent=0, box=((0.0, 0.0, 6.0), (10.0, 20.0, 9.5))),
    NewObject("ghost", "building"),
)


def rendering_record(name="tea"):
    frames = tuple(pin(BOX, 256, 0.1, VIEWS))
    return RenderingRecord(name, "town", 0.1, (LAYERS,), frames, BOX, title="Tea <time>", attribution="© City of Tea")


def solid_image(kind, color, px=256):
    """Returns a real picture of one colour."""
    data = BytesIO()
    with Image.new("RGB", (px, px), color) as picture:
        picture.save(data, kind, lossless=True)
    return data.getvalue()


FIRST_BYTES = {"webp": solid_image("WEBP", (200, 120, 60)), "png": solid_image("PNG", (128, 128, 255)), "jpeg": b"\xff\xd8\xff"}
"""The colour of the PNG is that of normals that point up."""


def tile_bytes(view, layer, tile, salt=""):
    """Returns a real picture and a comment behind it, for JPEG only its signature. Some tiles are equal, like tiles of plain
    ground."""
    kind = next(one.format for one in (*LAYERS, *ADDED) if one.name == layer)
    return FIRST_BYTES[kind] + f"{salt}{view}/{layer}/{tile.z}/{tile.x % 2}/{tile.y}".encode() * (1 + tile.x % 3)


def store_shape(record, number=0):
    return StoreShape(record.tile_px, record.zmax, record.passes[number])


def put_block(store, view, block, occupancy, version=1, salt=""):
    tiles = [tile for z in range(ZMAX + 1) for tile in occupancy.tiles(z) if block_of(tile, ZMAX) == block]
    stored = [StoredTile(n, *tile, tile_bytes(view, layer.name, tile, salt)) for n, layer in enumerate(store.shape.layers) for tile in tiles]
    return store.put_block(block, f"key{version}", version, stored, b"seam" if stored else None)


def make_workspace(root, name="tea", version=1):
    """Creates a workspace with one complete rendering of two views."""
    workspace = Workspace(root).create()
    record = rendering_record(name)
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town", crs=SceneCrs(25832, "PROJCRS[…]", "UTM 32N"), origin=(691000.0, 5336000.0, 500.0)))
    catalogue.create_rendering(record)
    catalogue.close()
    workspace.scene_folder("town").mkdir(parents=True, exist_ok=True)
    with Registry(workspace.registry_path("town")) as registry:
        registry.put_asset("houses", OBJECTS)
    workspace.rendering_folder(name).mkdir(parents=True)
    occupancy = Occupancy.from_tiles(ZMAX, OCCUPIED)
    _put_pass(workspace, record, 0, version)
    workspace.manifest_path(name).write_bytes(manifest_of(record, occupancy, version).dump())
    return workspace


def add_pass(workspace, name="tea", version=2):
    """Adds and renders the layers ADDED."""
    catalogue = workspace.open_catalogue()
    record = catalogue.add_pass(name, ADDED)
    catalogue.close()
    _put_pass(workspace, record, 1, version)
    workspace.manifest_path(name).write_bytes(manifest_of(record, Occupancy.from_tiles(ZMAX, OCCUPIED), 1, version).dump())


def _put_pass(workspace, record, number, version):
    for frame in record.frames:
        path = workspace.store_path(record.name, record.tracks_of(frame)[number].id)
        with SqliteTileStore.create(path, store_shape(record, number)) as store:
            for level in block_levels(ZMAX):
                for x in range(2**level.root):
                    for y in range(2**level.root):
                        put_block(store, frame.id, BlockId(level.root, x, y), Occupancy.from_tiles(ZMAX, OCCUPIED), version)


def manifest_of(record, occupancy, *versions):
    """`versions`: one for each pass."""
    return Manifest(
        name=record.name,
        title=record.title,
        attribution=record.attribution,
        content_version=max(versions),
        complete=True,
        crs=ManifestCrs("UTM 32N", 25832),
        origin=(691000.0, 5336000.0, 500.0),
        box=BOX,
        passes=record.passes,
        views=tuple(ManifestView(frame, occupancy, tuple(BlockVersions(version) for version in versions)) for frame in record.frames),
        objects=3,
    )


def every_tile():
    occupancy = Occupancy.from_tiles(ZMAX, OCCUPIED)
    return [TileId(*tile) for z in range(ZMAX + 1) for tile in occupancy.tiles(z)]
