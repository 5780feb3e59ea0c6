"""Turns a request for layers into the layers of a rendering."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from map3d.catalogue import SceneRecord
from map3d.errors import BadRequest
from map3d.renderings.sun_layers import LightRequest
from map3d.types import (
    COLOR_FORMATS,
    COLOR_KINDS,
    DEFAULT_DATA,
    DEFAULT_LAYERS,
    LAYER_KINDS,
    LAYERS,
    LAYERS_BY_DATA,
    Box,
    DataEncoding,
    Layer,
    LayerKind,
)

LOSSY: Final = ("webp", "jpeg")


@dataclass(frozen=True)
class LayerRequest:
    """`names`: KIND or NAME=KIND each; `color`, `quality`: format of the layers color and picture; `light`: parameters of sun and ambient occlusion
    layers; `small`: spends more time on encoding to save bytes."""

    names: Sequence[str] = DEFAULT_LAYERS
    color: str = COLOR_FORMATS[0]
    quality: int = 80
    light: LightRequest = field(default_factory=LightRequest)
    small: bool = False

    def check(self, scene: SceneRecord) -> dict[str, LayerKind]:
        """Returns name → kind, in the order of LAYER_KINDS. Raises BadRequest; does not need a built scene."""
        pairs = [_name_and_kind(text) for text in self.names]
        kinds = [kind for _, kind in pairs]
        if not pairs or len(set(kinds)) != len(kinds) or len(dict(pairs)) != len(pairs):
            given = ", ".join(self.names) or "none"
            raise BadRequest(
                f"layers {given}: give at least one, and each name and kind only once; map3d add-layers adds a second layer of the same kind"
            )
        self.light.check(kinds, scene)
        return dict(sorted(pairs, key=lambda item: LAYER_KINDS.index(item[1])))

    def layers(self, scene: SceneRecord, box: Box) -> tuple[Layer, ...]:
        """Returns the layers; the sun's position is computed for the centre of `box`, the scene's local box. Raises BadRequest, BadName."""
        return tuple(self._layer(name, kind, scene, box) for name, kind in self.check(scene).items())

    def _layer(self, name: str, kind: LayerKind, scene: SceneRecord, box: Box) -> Layer:
        suns, radius_m = self.light.suns(kind, scene, box), self.light.radius_of(kind)
        if kind in COLOR_KINDS:
            return Layer(name, kind, self.color, self.quality if self.color in LOSSY else None, suns, radius_m, self.small)
        return Layer(name, kind, LAYERS[kind].formats[0], suns=suns, radius_m=radius_m, small=self.small)


def choose_layers(names: Sequence[str] | None, data: DataEncoding | None) -> Sequence[str]:
    """Returns `names`; without them, color with normal, id and depth as `data` says. Raises BadRequest for both."""
    if names is None:
        return LAYERS_BY_DATA[data or DEFAULT_DATA]
    if data is not None:
        raise BadRequest("give either --layers or --data; in --layers, the kind data is the data tile and normal, id and depth are PNG layers")
    return names


def _name_and_kind(text: str) -> tuple[str, LayerKind]:
    name, _, kind = text.rpartition("=")
    if kind in LAYERS:
        return (name if "=" in text else kind), kind
    raise BadRequest(f"unknown layer {text!r}; write KIND or NAME=KIND, with one of {', '.join(LAYER_KINDS)}")
