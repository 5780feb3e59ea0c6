"""Which layers are asked for, and what becomes of the wish."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from map3d.catalogue import SceneRecord
from map3d.errors import BadRequest
from map3d.renderings.sun_layers import LightRequest
from map3d.types import COLOR_KINDS, DEFAULT_LAYERS, LAYER_KINDS, Box, Layer, LayerKind

LOSSY: Final = ("webp", "jpeg")


@dataclass(frozen=True)
class LayerRequest:
    """`names`: KIND or NAME=KIND each; `color` and `quality`: format of the layers color and picture; `light`: what layers of light need; `small`:
    encoding takes its time for fewer bytes."""

    names: Sequence[str] = DEFAULT_LAYERS
    color: str = "webp"
    quality: int = 80
    light: LightRequest = field(default_factory=LightRequest)
    small: bool = False

    def check(self, scene: SceneRecord) -> dict[str, LayerKind]:
        """Name → kind, in the order of LAYER_KINDS; raises BadRequest for what can be told before the scene is built."""
        wanted = [_name_and_kind(text) for text in self.names]
        kinds = [kind for _, kind in wanted]
        if not wanted or len(set(kinds)) != len(kinds) or len(dict(wanted)) != len(wanted):
            named = ", ".join(self.names) or "none"
            raise BadRequest(f"layers {named}: name at least one, each name and kind once; map3d add-layers adds another one of a kind")
        self.light.check(kinds, scene)
        return dict(sorted(wanted, key=lambda item: LAYER_KINDS.index(item[1])))

    def layers(self, scene: SceneRecord, box: Box) -> tuple[Layer, ...]:
        """As a rendering keeps them; `box`: the scene's local one, in whose middle the sun is looked up. Raises BadRequest, BadName."""
        return tuple(self._layer(name, kind, scene, box) for name, kind in self.check(scene).items())

    def _layer(self, name: str, kind: LayerKind, scene: SceneRecord, box: Box) -> Layer:
        suns, radius_m = self.light.suns(kind, scene, box), self.light.radius_of(kind)
        if kind in COLOR_KINDS:
            return Layer(name, kind, self.color, self.quality if self.color in LOSSY else None, suns, radius_m, self.small)
        return Layer(name, kind, "png", suns=suns, radius_m=radius_m, small=self.small)


def _name_and_kind(text: str) -> tuple[str, LayerKind]:
    name, _, kind = text.rpartition("=")
    for known in LAYER_KINDS:
        if kind == known:
            return (name if "=" in text else known), known
    raise BadRequest(f"layer {text!r} is not known; write KIND or NAME=KIND, with one of {', '.join(LAYER_KINDS)}")
