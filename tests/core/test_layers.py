"""What holds for every row of spec/layers.json. A place that a new kind lacks fails here (docs/recipes.md)."""

import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from map3d import _core, types
from map3d.geometry.core_frame import core_frame
from map3d.geometry.frames import PinnedFrame
from map3d.previews.view_preview import visible
from map3d.tiles.decode_tile import decode_tile
from map3d.types import LAYERS, Layer, LayerRow, Sun, ViewAngles

ROOT = Path(__file__).parents[2]
TABLE: list[dict[str, Any]] = json.loads((ROOT / "spec" / "layers.json").read_text())
LIMITS: dict[str, Any] = json.loads((ROOT / "spec" / "limits.json").read_text())
SCHEMA: dict[str, Any] = json.loads((ROOT / "spec" / "manifest.schema.json").read_text())["properties"]["layers"]["items"]["properties"]
NOON = Sun(None, 180.0, 45.0, (0.0, -(0.5**0.5), 0.5**0.5))
SIDE = 256


def layer_of(row: LayerRow) -> Layer:
    return Layer(row.kind, row.kind, row.formats[0], suns=(NOON,) * row.suns[1], radius_m=20.0 if row.radius else None)


each_kind = pytest.mark.parametrize("row", LAYERS.values(), ids=LAYERS)
each_array = pytest.mark.parametrize("row", [row for row in LAYERS.values() if row.array is not None], ids=lambda row: row.kind)


def test_the_core_has_the_table_of_the_specification_in_its_order() -> None:
    assert json.loads(_core.LAYERS) == TABLE


def test_the_manifests_schema_lists_the_kinds_and_formats() -> None:
    assert SCHEMA["kind"]["enum"] == [row["kind"] for row in TABLE]
    assert set(SCHEMA["format"]["enum"]) == {one for row in TABLE for one in row["formats"]}
    assert {SCHEMA["unit_m"]["const"]} == {row["unit_m"] for row in TABLE} - {None}


def test_every_format_has_a_media_type_and_a_suffix() -> None:
    formats = {one for row in LAYERS.values() for one in row.formats}
    assert formats == set(types.MEDIA_TYPES) == set(types.FILE_SUFFIXES)


def test_no_kind_has_more_suns_than_the_limit() -> None:
    assert max(row.suns[1] for row in LAYERS.values()) == LIMITS["suns"]


@each_kind
def test_a_frame_takes_a_layer_of_the_kind(row: LayerRow) -> None:
    frame = PinnedFrame(ViewAngles(0.0, 45.0), -50.0, 50.0, -200.0, 100.0, SIDE, 1)
    layer = layer_of(row)
    assert [spec.kind for spec in core_frame(frame.to_json((layer,))).layers] == [row.kind]
    assert Layer.load(json.loads(json.dumps(layer, default=lambda value: value.__dict__))) == layer


def array_of(row: LayerRow) -> np.ndarray[Any, Any]:
    """Returns an array of a G-buffer with values that differ from pixel to pixel."""
    assert row.array is not None
    name, _, channels = row.array.pixel.partition("x")
    shape = (SIDE, SIDE, int(channels)) if channels else (SIDE, SIDE)
    return np.arange(np.prod(shape)).reshape(shape).astype(name)


@each_array
def test_a_tile_of_the_kind_decodes_to_its_array(row: LayerRow) -> None:
    array = array_of(row)
    data = _core.encode_layer(row.kind, "png", array)
    pixels = decode_tile(Layer(row.kind, row.kind, "png", suns=layer_of(row).suns, radius_m=layer_of(row).radius_m), data, SIDE)[row.kind]
    assert pixels.shape[:2] == (SIDE, SIDE)
    if array.ndim == 2:
        assert pixels.dtype == array.dtype
        assert np.array_equal(pixels, array)


@each_array
def test_a_preview_shows_the_kind(row: LayerRow) -> None:
    buffer = {"id": np.full((SIDE, SIDE), 7, np.uint32), row.kind: array_of(row)}
    picture = visible(row.kind, buffer, None)
    assert (picture.shape, picture.dtype) == ((SIDE, SIDE, 3), np.uint8)
    assert Image.open(io.BytesIO(_core.encode_png("color", picture, range(3)))).size == (SIDE, SIDE)


@each_array
def test_the_studio_names_the_kind(row: LayerRow) -> None:
    parts = (ROOT / "python" / "map3d" / "web" / "templates" / "studio" / "parts.html").read_text("utf-8")
    assert f'"{row.kind}": _(' in parts, "its name in layer_names"


@each_kind
@pytest.mark.parametrize("page", ["docs/layers.md", "spec/pyramid.md", "spec/glossary.md"])
def test_the_documentation_names_the_kind(row: LayerRow, page: str) -> None:
    assert re.search(rf"^\|.*\b{row.kind}\b", (ROOT / page).read_text("utf-8"), re.MULTILINE)
