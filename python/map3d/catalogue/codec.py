"""Converts records to rows and JSON text, and back; shared by all implementations of the catalogue."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from map3d.catalogue.records import AssetRecord, RenderingRecord, SceneCrs, SceneRecord
from map3d.geometry.frames import PinnedFrame
from map3d.types import Box, Layer, Vec3, ViewAngles

RowLike = Mapping[str, Any] | Any
"""A row, indexed by column name."""


def dump_crs(crs: SceneCrs | None) -> str | None:
    return None if crs is None else json.dumps(asdict(crs))


def dump_or_none(value: Any) -> str | None:
    return None if value is None else json.dumps(value)


def pinned(scene: SceneRecord, crs: SceneCrs | None, origin: Vec3 | None, empty: bool) -> SceneRecord:
    """Returns the scene with `crs` and `origin` where they are still None. In an empty scene, `crs` may also add a vertical part."""
    first = scene.crs is None or (empty and _adds_heights(scene.crs, crs))
    return replace(scene, crs=crs if first else scene.crs, origin=scene.origin or origin)


def _adds_heights(before: SceneCrs, crs: SceneCrs | None) -> bool:
    """Whether `crs` is the same system with a vertical part added."""
    return crs is not None and before.vertical is None and crs.vertical is not None and (before.epsg, before.name) == (crs.epsg, crs.name)


def list_names(names: Sequence[str], limit: int = 20) -> str:
    """Returns the first names for an error message."""
    return ", ".join(names[:limit]) + (", …" if len(names) > limit else "") if names else "none"


def load_scene(row: RowLike) -> SceneRecord:
    return SceneRecord(
        name=row["name"],
        title=row["title"],
        attribution=row["attribution"],
        crs=None if row["crs"] is None else SceneCrs(**json.loads(row["crs"])),
        origin=None if row["origin"] is None else load_vec3(json.loads(row["origin"])),
        options=json.loads(row["options"]),
        built=row["built"],
    )


def load_asset(row: RowLike) -> AssetRecord:
    texts = {name: row[name] for name in ("scene", "name", "source", "format", "digest", "source_digest")}
    return AssetRecord(**texts, report=json.loads(row["report"]))


def dump_rendering(rendering: RenderingRecord) -> tuple[Any, ...]:
    return (
        rendering.name,
        rendering.scene,
        rendering.title,
        rendering.attribution,
        rendering.res_m,
        dump_passes(rendering.passes),
        dump_frames(rendering.frames),
        json.dumps(rendering.box),
        json.dumps(dict(rendering.options)),
        rendering.content_version,
        rendering.announced_version,
        int(rendering.planning),
    )


def dump_passes(passes: Iterable[Sequence[Layer]]) -> str:
    return json.dumps([[asdict(layer) for layer in layers] for layers in passes])


def dump_frames(frames: Iterable[PinnedFrame]) -> str:
    return json.dumps([frame.to_json() for frame in frames])


def load_rendering(row: RowLike) -> RenderingRecord:
    return RenderingRecord(
        name=row["name"],
        scene=row["scene"],
        title=row["title"],
        attribution=row["attribution"],
        res_m=row["res_m"],
        passes=tuple(tuple(Layer.load(layer) for layer in layers) for layers in json.loads(row["passes"])),
        frames=tuple(load_frame(frame) for frame in json.loads(row["frames"])),
        box=load_box(json.loads(row["box"])),
        options=json.loads(row["options"]),
        content_version=row["content_version"],
        announced_version=row["announced_version"],
        planning=bool(row["planning"]),
    )


def load_frame(value: Mapping[str, Any]) -> PinnedFrame:
    """Reverses `PinnedFrame.to_json`; the layers come from the rendering's passes."""
    numbers = {name: value[name] for name in ("u0_m", "v0_m", "d0_m", "size_m", "tile_px", "zmax")}
    return PinnedFrame(angles=ViewAngles(value["look_at_deg"], value["pitch_deg"]), **numbers)


def load_vec3(value: list[float]) -> Vec3:
    x, y, z = (float(number) for number in value)
    return (x, y, z)


def load_box(value: list[list[float]]) -> Box:
    low, high = value
    return (load_vec3(low), load_vec3(high))


def with_versions(rendering: RenderingRecord, content: int, announced: int) -> RenderingRecord:
    return replace(rendering, content_version=content, announced_version=announced, planning=False)


def dump_bits(bits: int | None) -> int | None:
    """Returns 64 bits as a signed number, which databases can store."""
    return bits if bits is None or bits < 1 << 63 else bits - (1 << 64)


def load_bits(number: int | None) -> int | None:
    return None if number is None else number % (1 << 64)
