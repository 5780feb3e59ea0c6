"""The manifest `rendering.json` (spec/manifest.md). Equal manifests have equal bytes; reading checks the version."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, Self

from map3d.errors import BadRequest, Corrupt, Map3dError, UnknownVersion
from map3d.geometry.frames import PinnedFrame
from map3d.geometry.views import parse_view_id
from map3d.registry.documents import ATTRIBUTES, COLUMNS, SEARCH, SHARDS
from map3d.tiles.block_versions import BlockVersions
from map3d.tiles.naming import block_level, block_of, parse_tile
from map3d.tiles.occupancy import Occupancy
from map3d.types import LAYERS, OBJECTS_PER_SHARD, BlockId, Box, Layer, TileId, Vec3, ViewAngles, check_name

VERSION: Final = 1
FILE_NAME: Final = "rendering.json"


@dataclass(frozen=True)
class ManifestCrs:
    """The scene's CRS. `epsg` and `vertical` are None if unknown, `wkt` is None for a local CRS. `heights`: "geoid", "ellipsoid" or "unknown";
    `vertical_epsg`: code of the vertical CRS, if it has one."""

    name: str
    epsg: int | None = None
    wkt: str | None = None
    vertical: str | None = None
    heights: str = "unknown"
    vertical_epsg: int | None = None


@dataclass(frozen=True)
class Geographic:
    """Polynomials between local x, y and WGS 84, with the terms 1, x, y, x², xy, y², … up to `degree` (spec/manifest.md). `error_m`: greatest
    error in both directions, within `unit_m` of `local`."""

    local: tuple[float, float]
    lon_lat: tuple[float, float]
    unit_m: float
    unit_deg: float
    degree: int
    to: tuple[tuple[float, ...], tuple[float, ...]]
    back: tuple[tuple[float, ...], tuple[float, ...]]
    error_m: float

    @classmethod
    def load(cls, row: Mapping[str, Any]) -> Self:
        (x, y), (lon, lat), to, back = (row[key] for key in ("local", "lon_lat", "to", "back"))
        return cls(
            local=(float(x), float(y)),
            lon_lat=(float(lon), float(lat)),
            unit_m=float(row["unit_m"]),
            unit_deg=float(row["unit_deg"]),
            degree=int(row["degree"]),
            to=_parse_polynomials(to),
            back=_parse_polynomials(back),
            error_m=float(row["error_m"]),
        )


@dataclass(frozen=True)
class Thumbnail:
    """A picture of a view's content. `window`: (left, top, width, height) in pixels of level 0; `webp`: the image in base64."""

    window: tuple[float, float, float, float]
    webp: str


@dataclass(frozen=True)
class ManifestView:
    """A view's frame and content. `versions`: for each pass; `archives`: layer → path, only in published folders; `thumbnail`:
    None while its tiles do not exist."""

    frame: PinnedFrame
    occupancy: Occupancy
    versions: tuple[BlockVersions, ...]
    archives: Mapping[str, str] | None = None
    thumbnail: Thumbnail | None = None


@dataclass(frozen=True)
class Manifest:
    """Everything that a client needs. `box`: of the content, local; `start`: local, None for the centre of the box; `start_radius_m`: of the circle
    around it that holds the first objects to be seen, or None; `start_view`: id of the view that is shown first, None for the first of `views`;
    `objects_box`: local, of all objects but the ground, or None; `archive_part_bytes`: size of the files in which archives are divided, 0 for whole
    archives."""

    name: str
    content_version: int
    complete: bool
    crs: ManifestCrs
    origin: Vec3
    box: Box
    passes: tuple[tuple[Layer, ...], ...]
    views: tuple[ManifestView, ...]
    title: str = ""
    attribution: str = ""
    start: Vec3 | None = None
    samples: int = 16
    objects: int = 0
    geographic: Geographic | None = None
    archive_part_bytes: int = 0
    description: str = ""
    start_view: str | None = None
    start_radius_m: float | None = None
    objects_box: Box | None = None

    def __post_init__(self) -> None:
        check_name(self.name, "rendering")
        if not self.passes or not all(self.passes) or not self.views:
            raise BadRequest(f"rendering {self.name}: the manifest has no layers or no views")
        if any(len(view.versions) != len(self.passes) for view in self.views):
            raise BadRequest(f"rendering {self.name}: expected block versions of {len(self.passes)} passes in every view")
        if len({(view.frame.size_m, view.frame.tile_px, view.frame.zmax, view.occupancy.zmax - view.frame.zmax) for view in self.views}) != 1:
            raise BadRequest(f"rendering {self.name}: the views differ in size, tile size or zmax")

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The layers of all passes."""
        return tuple(layer for layers in self.passes for layer in layers)

    @property
    def zmax(self) -> int:
        return self.views[0].frame.zmax

    @property
    def tile_px(self) -> int:
        return self.views[0].frame.tile_px

    def view(self, view_id: str) -> ManifestView | None:
        return next((view for view in self.views if view.frame.id == view_id), None)

    def with_archives(self, archives: Mapping[str, Mapping[str, str]], content_version: int, part_bytes: int = 0) -> Self:
        """Returns the manifest of a published folder. `archives`: view id → layer → path; `content_version`: also of every block."""
        versions = (BlockVersions(content_version),) * len(self.passes)
        views = tuple(replace(view, archives=archives[view.frame.id], versions=versions) for view in self.views)
        return replace(self, content_version=content_version, views=views, archive_part_bytes=part_bytes)

    def to_json(self) -> dict[str, Any]:
        frame = self.views[0].frame
        start = self.start or tuple((low + high) / 2 for low, high in zip(*self.box, strict=True))
        opening = {"radius_m": self.start_radius_m, "view": self.start_view}
        return {
            "map3d": "rendering",
            "version": VERSION,
            "name": self.name,
            "title": self.title,
            "attribution": self.attribution,
            **({"description": self.description} if self.description else {}),
            "content_version": self.content_version,
            "complete": self.complete,
            "crs": {key: getattr(self.crs, key) for key in ("epsg", "wkt", "name", "vertical", "heights", "vertical_epsg")},
            **({} if self.geographic is None else {"geographic": asdict(self.geographic)}),
            "origin": list(self.origin),
            "box": [list(corner) for corner in self.box],
            "start": {"local": list(start), **{name: value for name, value in opening.items() if value is not None}},
            "tile_px": frame.tile_px,
            "zmax": frame.zmax,
            "size_m": frame.size_m,
            "samples": self.samples,
            "layers": [_layer_json(layer) for layer in self.layers],
            **({"archive_part_bytes": self.archive_part_bytes} if self.archive_part_bytes else {}),
            "views": [_view_json(view, self.passes) for view in self.views],
            "objects": {
                "count": self.objects,
                **({} if self.objects_box is None else {"box": [list(corner) for corner in self.objects_box]}),
                "shard_size": OBJECTS_PER_SHARD,
                "shards": SHARDS,
                "search": SEARCH,
                "attributes": ATTRIBUTES,
                "columns": COLUMNS,
            },
        }

    def dump(self) -> bytes:
        """Serializes to UTF-8; equal manifests have equal bytes."""
        return (json.dumps(self.to_json(), ensure_ascii=False, indent=1, allow_nan=False) + "\n").encode()

    @classmethod
    def load(cls, data: bytes | str, where: str = FILE_NAME) -> Self:
        """Parses a manifest. Raises Corrupt, UnknownVersion, with `where` in the message."""
        value = _parse_document(data, where)
        try:
            passes = _load_passes(value)
            shape = {"size_m": float(value["size_m"]), "tile_px": int(value["tile_px"]), "zmax": int(value["zmax"])}
            return cls(
                name=value["name"],
                content_version=int(value["content_version"]),
                complete=bool(value["complete"]),
                crs=ManifestCrs(
                    **{key: value["crs"][key] for key in ("name", "epsg", "wkt", "vertical")},
                    **{key: value["crs"][key] for key in ("heights", "vertical_epsg") if key in value["crs"]},
                ),
                origin=_parse_vec3(value["origin"]),
                box=(_parse_vec3(value["box"][0]), _parse_vec3(value["box"][1])),
                passes=passes,
                views=tuple(_load_view(row, shape, passes) for row in value["views"]),
                title=value["title"],
                attribution=value["attribution"],
                start=_parse_vec3(value["start"]["local"]),
                samples=int(value["samples"]),
                objects=int(value["objects"]["count"]),
                geographic=Geographic.load(value["geographic"]) if "geographic" in value else None,
                archive_part_bytes=int(value.get("archive_part_bytes", 0)),
                description=value.get("description", ""),
                start_view=value["start"].get("view"),
                start_radius_m=value["start"].get("radius_m"),
                objects_box=_parse_box(value["objects"].get("box")),
            )
        except (KeyError, TypeError, ValueError, IndexError, AttributeError, Map3dError) as error:
            raise Corrupt(f"{where}: invalid manifest: {type(error).__name__}: {error}") from error


def _parse_document(data: bytes | str, where: str) -> dict[str, Any]:
    try:
        value = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise Corrupt(f"{where}: not JSON: {error}") from error
    if not isinstance(value, dict) or value.get("map3d") != "rendering":
        raise Corrupt(f"{where}: not the manifest of a rendering")
    if value.get("version") != VERSION:
        raise UnknownVersion(f"{where}: manifest version {value.get('version')}; this map3d reads version {VERSION}")
    return value


def _layer_json(layer: Layer) -> dict[str, Any]:
    row: dict[str, Any] = {"name": layer.name, "kind": layer.kind, "format": layer.format, "media_type": layer.media_type}
    if (unit_m := LAYERS[layer.kind].unit_m) is not None:
        row["unit_m"] = unit_m
    if layer.suns:
        row["suns"] = [{**asdict(sun), "direction": list(sun.direction)} for sun in layer.suns]
    if layer.radius_m is not None:
        row["radius_m"] = layer.radius_m
    return row


def _view_json(view: ManifestView, passes: Sequence[Sequence[Layer]]) -> dict[str, Any]:
    frame, (first, *later) = view.frame, view.versions
    row: dict[str, Any] = {
        "id": frame.id,
        "look_at_deg": frame.angles.look_at_deg,
        "pitch_deg": frame.angles.pitch_deg,
        "u0_m": frame.u0_m,
        "v0_m": frame.v0_m,
        "d0_m": frame.d0_m,
        "occupancy": view.occupancy.encode(),
        **_versions_json(first),
    }
    if later:
        added = zip(passes[1:], later, strict=True)
        row["passes"] = [{"layers": [layer.name for layer in layers], **_versions_json(versions)} for layers, versions in added]
    if view.archives is not None:
        row["archives"] = dict(view.archives)
    if view.thumbnail is not None:
        row["thumbnail"] = {"window": list(view.thumbnail.window), "webp": view.thumbnail.webp}
    return row


def _versions_json(versions: BlockVersions) -> dict[str, Any]:
    return {"version": versions.common, "versions": {str(block): version for block, version in sorted(versions.others.items())}}


def _load_passes(value: Mapping[str, Any]) -> tuple[tuple[Layer, ...], ...]:
    """Returns the layers by pass; the first view lists the layers that were added later."""
    layers = {row["name"]: Layer.load(row) for row in value["layers"]}
    if len(layers) != len(value["layers"]):
        raise Corrupt("two layers have the same name")
    later = [tuple(layers.pop(name) for name in added["layers"]) for added in value["views"][0].get("passes", ())]
    return (tuple(layers.values()), *later)


def _load_view(row: Mapping[str, Any], shape: Mapping[str, Any], passes: Sequence[Sequence[Layer]]) -> ManifestView:
    angles = ViewAngles(row["look_at_deg"], row["pitch_deg"])
    if parse_view_id(row["id"]) != angles:
        raise Corrupt(f"view {row['id']}: the angles {angles.look_at_deg} and {angles.pitch_deg} do not match its id")
    frame = PinnedFrame(angles=angles, u0_m=float(row["u0_m"]), v0_m=float(row["v0_m"]), d0_m=float(row["d0_m"]), **shape)
    occupancy = Occupancy.decode(frame.zmax, row["occupancy"])
    later = row.get("passes", [])
    if [added["layers"] for added in later] != [[layer.name for layer in layers] for layers in passes[1:]]:
        raise Corrupt(f"view {row['id']}: the passes differ from those of the first view")
    versions = tuple(_load_versions(part, frame.zmax) for part in (row, *later))
    return ManifestView(frame, occupancy, versions, row.get("archives"), _load_thumbnail(row.get("thumbnail")))


def _load_thumbnail(row: Mapping[str, Any] | None) -> Thumbnail | None:
    if row is None:
        return None
    left, top, width, height = (float(number) for number in row["window"])
    return Thumbnail((left, top, width, height), str(row["webp"]))


def _load_versions(row: Mapping[str, Any], zmax: int) -> BlockVersions:
    return BlockVersions(int(row["version"]), {_parse_block(text, zmax): int(version) for text, version in row["versions"].items()})


def _parse_block(text: str, zmax: int) -> BlockId:
    tile = parse_tile(*text.split("/"))
    if tile is None:
        raise Corrupt(f"versions: {text!r} is not a block")
    block_level(tile.z, zmax)
    return BlockId(*tile)


def _parse_polynomials(value: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    first, second = (tuple(float(c) for c in row) for row in value)
    return first, second


def _parse_box(value: Any) -> Box | None:
    return None if value is None else (_parse_vec3(value[0]), _parse_vec3(value[1]))


def _parse_vec3(value: Any) -> Vec3:
    x, y, z = (float(number) for number in value)
    return (x, y, z)


def block_version(view: ManifestView, tile: TileId, number: int = 0) -> int:
    """Returns the version for a tile's URL, for a layer of pass `number`."""
    return view.versions[number][block_of(tile, view.frame.zmax)]
