"""Turns a request for layers into the layers of a rendering."""

from collections.abc import Sequence
from typing import Final

from map3d.catalogue import SceneRecord
from map3d.errors import BadRequest
from map3d.renderings.sun_layers import check_light, radius_of, suns_of
from map3d.requests import LayerDetails
from map3d.types import COLOR_KINDS, LAYER_KINDS, LAYERS, Box, Layer, LayerKind

LOSSY: Final = ("webp", "jpeg")


def check_layers(names: Sequence[str], details: LayerDetails, scene: SceneRecord) -> dict[str, LayerKind]:
    """Returns name → kind, in the order of LAYER_KINDS, of names that are KIND or NAME=KIND. Raises BadRequest; does not need a built scene."""
    pairs = [_name_and_kind(text) for text in names]
    kinds = [kind for _, kind in pairs]
    if not pairs or len(set(kinds)) != len(kinds) or len(dict(pairs)) != len(pairs):
        given = ", ".join(names) or "none"
        raise BadRequest(
            f"layers {given}: give at least one, and each name and kind only once; map3d add-layers adds a second layer of the same kind"
        )
    check_light(details, kinds, scene)
    return dict(sorted(pairs, key=lambda item: LAYER_KINDS.index(item[1])))


def make_layers(names: Sequence[str], details: LayerDetails, scene: SceneRecord, box: Box) -> tuple[Layer, ...]:
    """Returns the layers; the sun's position is computed for the centre of `box`, the scene's local box. Raises BadRequest, BadName."""
    return tuple(_layer(name, kind, details, scene, box) for name, kind in check_layers(names, details, scene).items())


def _layer(name: str, kind: LayerKind, details: LayerDetails, scene: SceneRecord, box: Box) -> Layer:
    suns, radius_m = suns_of(details, kind, scene, box), radius_of(details, kind)
    if kind in COLOR_KINDS:
        return Layer(name, kind, details.color, details.quality if details.color in LOSSY else None, suns, radius_m, details.small)
    return Layer(name, kind, LAYERS[kind].formats[0], suns=suns, radius_m=radius_m, small=details.small)


def _name_and_kind(text: str) -> tuple[str, LayerKind]:
    name, _, kind = text.rpartition("=")
    if kind in LAYERS:
        return (name if "=" in text else kind), kind
    raise BadRequest(f"unknown layer {text!r}; write KIND or NAME=KIND, with one of {', '.join(LAYER_KINDS)}")
