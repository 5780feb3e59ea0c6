"""Which layers are asked for, and what becomes of the wish."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from map3d.errors import BadRequest
from map3d.types import LAYER_KINDS, Layer, LayerKind

LOSSY: Final = ("webp", "jpeg")


@dataclass(frozen=True)
class LayerRequest:
    """`names`: KIND or NAME=KIND each; `color` and `quality` are the colour layer's."""

    names: Sequence[str] = LAYER_KINDS
    color: str = "webp"
    quality: int = 80

    def check(self) -> dict[str, LayerKind]:
        """Name → kind, in the order of LAYER_KINDS; raises BadRequest."""
        wanted = [_name_and_kind(text) for text in self.names]
        kinds = [kind for _, kind in wanted]
        if not wanted or len(set(kinds)) != len(kinds) or len(dict(wanted)) != len(wanted):
            named = ", ".join(self.names) or "none"
            raise BadRequest(f"layers {named}: name at least one, each name and kind once; map3d add-layers adds another one of a kind")
        return dict(sorted(wanted, key=lambda item: LAYER_KINDS.index(item[1])))

    def layers(self) -> tuple[Layer, ...]:
        """As a rendering keeps them. Raises BadRequest, BadName."""
        return tuple(self._layer(name, kind) for name, kind in self.check().items())

    def _layer(self, name: str, kind: LayerKind) -> Layer:
        if kind == "color":
            return Layer(name, kind, self.color, self.quality if self.color in LOSSY else None)
        return Layer(name, kind, "png")


def _name_and_kind(text: str) -> tuple[str, LayerKind]:
    name, _, kind = text.rpartition("=")
    for known in LAYER_KINDS:
        if kind == known:
            return (name if "=" in text else known), known
    raise BadRequest(f"layer {text!r} is not known; write KIND or NAME=KIND, with one of {', '.join(LAYER_KINDS)}")
