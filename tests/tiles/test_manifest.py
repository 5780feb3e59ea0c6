import json
from dataclasses import replace
from pathlib import Path

import pytest

from map3d.errors import BadName, BadRequest, Corrupt, UnknownVersion
from map3d.geometry.frames import pin
from map3d.tiles.block_versions import BlockVersions
from map3d.tiles.manifest import Geographic, Manifest, ManifestCrs, ManifestView, Thumbnail, block_version
from map3d.tiles.occupancy import Occupancy
from map3d.types import BlockId, Layer, Sun, TileId, ViewAngles

SCHEMA = json.loads((Path(__file__).parents[2] / "spec" / "manifest.schema.json").read_text())
BOX = ((-120.0, -80.0, 0.0), (130.0, 90.0, 22.5))
LAYERS = (Layer("color", "color", "webp"), Layer("normal", "normal", "png"), Layer("id", "id", "png"), Layer("depth", "depth", "png"))

THUMBNAIL = Thumbnail((76.0, 95.0, 102.0, 70.5), "UklGRg==")


@pytest.fixture
def manifest():
    frames = pin(BOX, 256, 0.1, [ViewAngles(0, 45), ViewAngles(45, 22.5)])
    zmax = frames[0].zmax
    occupancy = Occupancy.from_tiles(zmax, [(0, 0), (2**zmax - 1, 2**zmax - 1)])
    versions = {BlockId(1, 0, 0): 3, BlockId(1, 1, 1): 2, BlockId(0, 0, 0): 3}
    return Manifest(
        name="teatime",
        title="Tea “time” ☕",
        attribution="© City of Tea",
        content_version=3,
        complete=True,
        crs=ManifestCrs("ETRS89 / UTM zone 32N", 25832, "PROJCRS[…]", "DHHN92 height"),
        origin=(691000.0, 5336000.0, 500.0),
        box=BOX,
        passes=(LAYERS,),
        views=tuple(ManifestView(frame, occupancy, (BlockVersions.of(versions.items()),)) for frame in frames),
        objects=54,
    )


def test_a_manifest_reads_back(manifest):
    again = Manifest.load(manifest.dump())
    assert again == replace(manifest, start=(5.0, 5.0, 11.25))
    assert again.dump() == manifest.dump()


GEOGRAPHIC = Geographic(
    (5.0, 5.0), (11.5, 48.1), 656.25, 0.0087, 1, ((0.0, 0.0087, 0.0001), (0.0, 0.0001, 0.0058)), ((0.0, 650.0, 1.0), (0.0, 1.0, 970.0)), 0.01
)


def test_thumbnails_read_back(manifest):
    first, *others = manifest.views
    shown = replace(manifest, views=(replace(first, thumbnail=THUMBNAIL), *others))
    assert Manifest.load(shown.dump()).views[0].thumbnail == shown.views[0].thumbnail
    pytest.importorskip("jsonschema").validate(shown.to_json(), SCHEMA)
    assert b"thumbnail" not in manifest.dump()


def test_the_geographic_position_reads_back(manifest):
    placed = replace(manifest, geographic=GEOGRAPHIC)
    assert Manifest.load(placed.dump()).geographic == GEOGRAPHIC
    assert b"geographic" not in manifest.dump()


NOON = Sun("2026-06-21T13:00:00Z", 196.2, 64.1, (-0.1, -0.4, 0.9))
LIGHT = (
    Layer("evening", "sun", "png", suns=(Sun(None, 280.0, 12.5, (-0.9, 0.2, 0.2)),)),
    Layer("day", "sun16", "png", suns=(NOON,) * 16),
    Layer("ao", "ao", "png", radius_m=20.0),
    Layer("behind", "depth2", "png"),
    Layer("picture", "picture", "webp", suns=(NOON,), radius_m=0.5),
)


@pytest.fixture
def added(manifest):
    """A manifest with a second, partly rendered pass."""
    views = tuple(replace(view, versions=(*view.versions, BlockVersions(4))) for view in manifest.views)
    return replace(manifest, passes=(*manifest.passes, LIGHT), views=views)


def test_light_layers_have_suns_and_radii(added):
    layers = {layer["name"]: layer for layer in json.loads(added.dump())["layers"]}
    noon = {"time": "2026-06-21T13:00:00Z", "azimuth_deg": 196.2, "elevation_deg": 64.1, "direction": [-0.1, -0.4, 0.9]}
    png = {"format": "png", "media_type": "image/png"}
    assert layers["evening"] == {
        "name": "evening", "kind": "sun", **png, "suns": [{"time": None, "azimuth_deg": 280.0, "elevation_deg": 12.5, "direction": [-0.9, 0.2, 0.2]}],
    }  # fmt: skip
    assert layers["day"] == {"name": "day", "kind": "sun16", **png, "suns": [noon] * 16}
    assert layers["ao"] == {"name": "ao", "kind": "ao", **png, "radius_m": 20.0}
    assert layers["behind"] == {"name": "behind", "kind": "depth2", **png, "unit_m": 2**-10}
    assert layers["picture"] == {
        "name": "picture", "kind": "picture", "format": "webp", "media_type": "image/webp", "suns": [noon], "radius_m": 0.5,
    }  # fmt: skip
    assert Manifest.load(added.dump()).passes == added.passes


def test_added_layers_have_their_own_versions(added):
    value = json.loads(added.dump())
    assert [layer["name"] for layer in value["layers"]] == ["color", "normal", "id", "depth", "evening", "day", "ao", "behind", "picture"]
    assert (value["views"][0]["version"], value["views"][0]["versions"]) == (3, {"1/1/1": 2})
    assert value["views"][1]["passes"] == [{"layers": [layer.name for layer in LIGHT], "version": 4, "versions": {}}]
    again = Manifest.load(added.dump())
    assert (again.passes, again.layers) == (added.passes, added.layers)
    assert (block_version(again.views[0], TileId(4, 15, 15), 1), block_version(again.views[0], TileId(4, 15, 15))) == (4, 2)


@pytest.mark.parametrize(
    "passes",
    [
        None,
        [{"layers": ["ao"], "version": 4, "versions": {}}],
        [{"layers": ["nowhere"], "version": 4, "versions": {}}],
        [{"layers": ["ao", "ao"], "version": 4, "versions": {}}],
        [{"layers": [], "version": 4, "versions": {}}],
        [{"layers": [layer.name for layer in LIGHT], "versions": {}}],
    ],
)
@pytest.mark.parametrize("view", [0, 1])
def test_inconsistent_passes_are_corrupt(added, view, passes):
    value = json.loads(added.dump())
    value["views"][view]["passes"] = passes
    with pytest.raises(Corrupt):
        Manifest.load(json.dumps(value))


def test_the_document_matches_the_specification(manifest):
    value = json.loads(manifest.dump())
    assert (value["map3d"], value["version"], value["size_m"]) == ("rendering", 1, 409.6)
    assert value["start"] == {"local": [5.0, 5.0, 11.25]}
    assert value["layers"][3] == {"name": "depth", "kind": "depth", "format": "png", "media_type": "image/png", "unit_m": 2**-10}
    assert value["views"][1]["id"] == "45-22.5"
    assert (value["views"][0]["version"], value["views"][0]["versions"]) == (3, {"1/1/1": 2})
    assert "archives" not in value["views"][0]
    files = {
        "shards": "objects/{shard}.json",
        "search": "objects/search.json",
        "attributes": "objects/attributes.json",
        "columns": "objects/columns/{column}.json",
    }
    assert value["objects"] == {"count": 54, "shard_size": 1024} | files


@pytest.mark.parametrize(("kind", "format"), [("data", "png"), ("data", "webp"), ("normal", "m3d"), ("color", "m3d")])
def test_data_tiles_are_the_format_of_the_data_layer_alone(manifest, kind, format):
    value = json.loads(manifest.dump())
    value["layers"][0] |= {"kind": kind, "format": format}
    with pytest.raises(Corrupt, match=f"format '{format}' cannot hold {kind}"):
        Manifest.load(json.dumps(value))


def test_the_schema_lists_every_member(manifest, added):
    archives = {view.frame.id: {"color": f"{view.frame.id}/color.pmtiles"} for view in manifest.views}
    shown = tuple(replace(view, thumbnail=THUMBNAIL) for view in added.views)
    opening = {"start_view": "45-22.5", "start_radius_m": 80.0, "objects_box": added.box}
    described = replace(added, geographic=GEOGRAPHIC, views=shown, description="Tea", **opening)
    value = described.with_archives(archives, 7, 1 << 20).to_json()
    schema = SCHEMA["properties"]
    assert set(schema) == set(value) == {*SCHEMA["required"], "geographic", "archive_part_bytes", "description"}
    assert set(schema["start"]["properties"]) == set(value["start"])
    assert Manifest.load(json.dumps(value)).to_json() == value
    assert set(schema["views"]["items"]["properties"]) == set(value["views"][0])
    assert set(schema["layers"]["items"]["properties"]) == set().union(*value["layers"])
    assert set(schema["crs"]["properties"]) == set(value["crs"])
    assert set(schema["objects"]["properties"]) == set(value["objects"])


def test_the_schema_accepts_manifests(manifest, added):
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    jsonschema.validate(manifest.to_json(), SCHEMA)
    jsonschema.validate(added.to_json(), SCHEMA)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**manifest.to_json(), "version": 2}, SCHEMA)


def test_only_published_folders_have_archives(manifest):
    archives = {view.frame.id: {"color": f"{view.frame.id}/color.pmtiles"} for view in manifest.views}
    published = Manifest.load(manifest.with_archives(archives, 7).dump())
    assert published.view("45-22.5").archives == {"color": "45-22.5/color.pmtiles"}
    assert (published.content_version, published.views[0].versions[0]) == (7, BlockVersions(7))


def test_a_tile_has_the_version_of_its_block(manifest):
    view = manifest.views[0]
    assert block_version(view, TileId(4, 15, 15)) == 2
    assert block_version(view, TileId(4, 0, 15)) == 3
    assert block_version(view, TileId(0, 0, 0)) == 3


def test_a_rendering_without_tiles_has_a_manifest(manifest):
    empty = replace(
        manifest, complete=False, objects=0, views=(ManifestView(manifest.views[0].frame, Occupancy.from_tiles(4, []), (BlockVersions(),)),)
    )
    assert Manifest.load(empty.dump()).views[0].occupancy.count() == 0


def test_another_version_is_refused_with_both_numbers(manifest):
    with pytest.raises(UnknownVersion, match=r"7.*1"):
        Manifest.load(json.dumps({**manifest.to_json(), "version": 7}))


@pytest.mark.parametrize(
    "data", [b"", b"{", b"[]", b"null", b'{"map3d": "search", "version": 1}', b'{"map3d": "rendering", "version": 1}', b"\xff", b"[" * 100000]
)
def test_other_documents_are_corrupt(data):
    with pytest.raises(Corrupt):
        Manifest.load(data)


@pytest.mark.parametrize(
    ("where", "value"),
    [
        (("views", 0, "occupancy"), "AA"),
        (("views", 0, "id"), "0-46"),
        (("views", 0, "versions"), {"2/0/0": 1}),
        (("views", 0, "versions"), {"x": 1}),
        (("views", 0, "u0_m"), "zero"),
        (("views",), []),
        (("layers", 0, "format"), "bmp"),
        (("layers", 0, "radius_m"), 20),
        (("layers", 0, "suns"), [{"time": None, "azimuth_deg": 0, "elevation_deg": 90, "direction": [0, 0, 1]}]),
        (("layers", 0, "suns"), [{}]),
        (("layers",), None),
        (("origin",), [1, 2]),
        (("box",), [[0, 0, 0]]),
        (("name",), "../x"),
        (("zmax",), 3),
        (("crs",), None),
    ],
)
def test_a_manifest_with_an_invalid_member_is_corrupt(manifest, where, value):
    document = manifest.to_json()
    inner = document
    for step in where[:-1]:
        inner = inner[step]
    inner[where[-1]] = value
    with pytest.raises(Corrupt):
        Manifest.load(json.dumps(document))


def test_inconsistent_manifests_are_refused(manifest):
    with pytest.raises(BadName):
        replace(manifest, name="Tea Time")
    with pytest.raises(BadRequest):
        replace(manifest, views=())
    with pytest.raises(BadRequest, match="2 passes"):
        replace(manifest, passes=(*manifest.passes, LAYERS[:1]))
    with pytest.raises(BadRequest, match="differ in size"):
        replace(manifest, views=(*manifest.views, ManifestView(pin(BOX, 256, 0.3, [ViewAngles(90, 45)])[0], Occupancy.from_tiles(3, []), ({},))))
