"""The preview picture of a rendering, in the format of social networks."""

import io
from dataclasses import dataclass
from typing import Final

import numpy as np
from PIL import Image

from map3d.catalogue import RenderingRecord, Workspace
from map3d.errors import Corrupt
from map3d.geometry.views import track_id
from map3d.tiles.decode_tile import decode_tile, layer_with, paste, with_alpha
from map3d.tiles.light_colors import DEFAULT_LIGHT, Pixels, light_colors
from map3d.tiles.manifest import Manifest
from map3d.tiles.preview import Preview, choose_preview
from map3d.tiles.track_stores import open_track
from map3d.types import COLOR_KINDS, Layer, TileId

FILE: Final = "preview.jpg"
WIDTH_PX: Final = 1200
HEIGHT_PX: Final = 630
QUALITY: Final = 82
BACKGROUND: Final = (242, 240, 235)
"""Colour of the viewer's page around the model."""
_SHAPES: Final[dict[str, tuple[int, ...]]] = {"color": (4,), "picture": (4,), "normal": (3,), "ao": ()}
"""Channels of a pixel by kind."""


def make_preview(workspace: Workspace, record: RenderingRecord, manifest: Manifest) -> bytes | None:
    """Returns a JPEG that shows what the rendering contains, lit as in the viewer; None while no tile of a colour layer is stored. Raises Corrupt,
    StoreError."""
    chosen = choose_preview(manifest, aspect=WIDTH_PX / HEIGHT_PX, min_width_px=WIDTH_PX)
    if chosen is None:
        return None
    window = _PreviewWindow(workspace, record, manifest, chosen)
    colors = window.read(chosen.layer, chosen.layer.kind)
    if colors is None:
        return None
    if chosen.layer.kind == "color":
        colors[..., :3] = _light(window, colors[..., :3])
    with Image.new("RGB", (WIDTH_PX, HEIGHT_PX), BACKGROUND) as picture, Image.fromarray(colors, "RGBA") as drawn:
        with drawn.resize(picture.size, Image.Resampling.LANCZOS) as scaled:
            picture.paste(scaled, mask=scaled)
        data = io.BytesIO()
        picture.save(data, "JPEG", quality=QUALITY, optimize=True)
    return data.getvalue()


def _light(window: "_PreviewWindow", rgb: Pixels) -> Pixels:
    """Lights colours by the layers that the rendering has."""
    normals, openness = window.read_kind("normal"), window.read_kind("ao")
    return rgb if normals is None else light_colors(rgb, normals, DEFAULT_LIGHT, openness)


@dataclass(frozen=True)
class _PreviewWindow:
    workspace: Workspace
    record: RenderingRecord
    manifest: Manifest
    preview: Preview

    def read_kind(self, kind: str) -> Pixels | None:
        layer = layer_with(self.manifest.layers, kind)
        return None if layer is None else self.read(layer, kind)

    def read(self, layer: Layer, kind: str) -> Pixels | None:
        """Returns the pixels of a kind that a layer holds: RGBA of colours, (H, W, 3) of normals, (H, W) of ao; None if no tile is stored. Nothing is
        0, in ao 255."""
        left, top, width, height = self.preview.window
        number = next(number for number, layers in enumerate(self.manifest.passes) if layer in layers)
        window: Pixels = np.full((round(height), round(width), *_SHAPES[kind]), 255 if kind == "ao" else 0, np.uint8)
        drawn = False
        with open_track(self.workspace, self.record, track_id(self.preview.view, number)) as store:
            for tile in self.preview.tiles:
                data = store.get_tile(store.shape.layer_number(layer.name), *tile)
                if data is not None:
                    pixels = self._decode(layer, kind, data, tile, store.url)
                    paste(window, pixels, tile.x * self.manifest.tile_px - round(left), tile.y * self.manifest.tile_px - round(top))
                    drawn = True
        return window if drawn else None

    def _decode(self, layer: Layer, kind: str, data: bytes, tile: TileId, url: str) -> Pixels:
        try:
            pixels = decode_tile(layer, data, self.manifest.tile_px)[kind]
        except Corrupt as error:
            path = f"{self.preview.view}/{layer.name}/{tile.z}/{tile.x}/{tile.y}"
            raise Corrupt(f"{url}: tile {path}: {error}; run: map3d verify") from error
        return with_alpha(pixels) if kind in COLOR_KINDS else pixels
