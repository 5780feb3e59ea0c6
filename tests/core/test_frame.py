"""Frames and layers as the core takes them."""

from typing import Any

import pytest

from map3d import _core
from map3d.geometry.core_frame import core_frame
from map3d.geometry.frames import pin
from map3d.types import Layer, Sun, ViewAngles

NUMBERS: dict[str, Any] = {"look_at_deg": 45.0, "pitch_deg": 22.5, "u0_m": -51.2, "v0_m": 51.2, "d0_m": -1000.0, "size_m": 102.4}
FIELDS: dict[str, Any] = {**NUMBERS, "tile_px": 256, "zmax": 3}
SUN = Sun(None, 180.0, 45.0, (0.0, -0.6, 0.8))


def test_a_frame_has_the_fields_that_it_was_made_of() -> None:
    layers = [_core.LayerSpec("color", "webp", 70, True), _core.LayerSpec("sun", "png", suns=[SUN.direction])]
    frame = _core.Frame(**FIELDS, layers=layers)
    assert {name: getattr(frame, name) for name in FIELDS} == FIELDS
    assert frame.layers == layers
    assert [layer.kind for layer in frame.layers] == ["color", "sun"]
    assert [(layer.format, layer.quality, layer.small, layer.radius_m) for layer in frame.layers] == [
        ("webp", 70, True, 0.0),
        ("png", 80, False, 0.0),
    ]
    assert frame.layers[1].suns == [SUN.direction]


def test_frames_of_equal_fields_are_equal() -> None:
    assert _core.Frame(**FIELDS) == _core.Frame(**FIELDS)
    assert _core.Frame(**FIELDS) != _core.Frame(**{**FIELDS, "zmax": 4})
    assert _core.Frame(**FIELDS) != _core.Frame(**FIELDS, layers=[_core.LayerSpec("id", "png")])


@pytest.mark.parametrize("name", ["zmax", "layers", "other"])
def test_a_frame_cannot_be_changed(name: str) -> None:
    with pytest.raises(AttributeError):
        setattr(_core.Frame(**FIELDS), name, 1)


def test_a_pinned_frame_becomes_a_frame_with_layers() -> None:
    pinned = pin(((0.0, 0.0, 0.0), (100.0, 80.0, 10.0)), 512, 0.1, [ViewAngles(37.5, 45)])[0]
    layers = [Layer("c", "color", "jpeg", 90), Layer("ao", "ao", "png", radius_m=20.0), Layer("noon", "sun", "png", suns=(SUN,), small=True)]
    frame = core_frame(pinned.to_json(layers))
    assert (frame.look_at_deg, frame.pitch_deg, frame.tile_px, frame.zmax) == (37.5, 45.0, 512, pinned.zmax)
    assert [frame.u0_m, frame.v0_m, frame.d0_m, frame.size_m] == pytest.approx([pinned.u0_m, pinned.v0_m, pinned.d0_m, pinned.size_m], rel=1e-15)
    expected = [("color", 90, 0.0, False), ("ao", 80, 20.0, False), ("sun", 80, 0.0, True)]
    assert [(layer.kind, layer.quality, layer.radius_m, layer.small) for layer in frame.layers] == expected


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pitch_deg": 0.0}, "pitch_deg"),
        ({"size_m": float("nan")}, "finite"),
        ({"size_m": 0.0}, "size_m"),
        ({"tile_px": 300}, "tile_px"),
        ({"zmax": 27}, "zmax"),
    ],
)
def test_a_frame_with_a_wrong_field_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(_core.InvalidArgument, match=message):
        _core.Frame(**{**FIELDS, **change})


@pytest.mark.parametrize(
    ("layer", "message"),
    [
        ({"kind": "moon", "format": "png"}, "kind"),
        ({"kind": "color", "format": "gif"}, "format"),
        ({"kind": "sun", "format": "png"}, "suns"),
        ({"kind": "sun", "format": "png", "suns": [(0.0, 0.0, 2.0)]}, "unit vector"),
        ({"kind": "ao", "format": "png", "radius_m": 0.1}, "radius_m"),
        ({"kind": "color", "format": "webp", "quality": 0}, "quality"),
    ],
)
def test_a_wrong_layer_is_refused(layer: dict[str, Any], message: str) -> None:
    with pytest.raises(_core.InvalidArgument, match=message):
        _core.Frame(**FIELDS, layers=[_core.LayerSpec(**layer)])


def test_two_layers_of_a_kind_are_refused() -> None:
    with pytest.raises(_core.InvalidArgument, match="one of a kind"):
        _core.Frame(**FIELDS, layers=[_core.LayerSpec("id", "png")] * 2)
