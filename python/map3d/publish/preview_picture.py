"""The preview picture of a rendering, in the format of social networks."""

import io
from dataclasses import dataclass
from typing import Final

import numpy as np
from PIL import Image

from map3d.catalogue import RenderingRecord, Workspace
from map3d.errors import Corrupt
from map3d.geometry.views import track_id
from map3d.renderings.track_stores import open_track
from map3d.tiles.light_colors import DEFAULT_LIGHT, Pixels, light_colors
from map3d.tiles.manifest import Manifest
from map3d.tiles.preview import Preview, choose_preview
from map3d.types import Layer, TileId

FILE: Final = "preview.jpg"
WIDTH_PX: Final = 1200
HEIGHT_PX: Final = 630
QUALITY: Final = 82
BACKGROUND: Final = (242, 240, 235)
"""Colour of the viewer's page around the model."""


def make_preview(workspace: Workspace, record: RenderingRecord, manifest: Manifest) -> bytes | None:
    """Returns a JPEG that shows what the rendering contains, lit as in the viewer; None while no tile of a colour layer is stored. Raises Corrupt,
    StoreError."""
    chosen = choose_preview(manifest, aspect=WIDTH_PX / HEIGHT_PX, min_width_px=WIDTH_PX)
    if chosen is None:
        return None
    window = _PreviewWindow(workspace, record, manifest, chosen)
    colors = window.read(chosen.layer, "RGBA")
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
    normals, openness = window.read_kind("normal", "RGB"), window.read_kind("ao", "L")
    return rgb if normals is None else light_colors(rgb, normals, DEFAULT_LIGHT, openness)


@dataclass(frozen=True)
class _PreviewWindow:
    workspace: Workspace
    record: RenderingRecord
    manifest: Manifest
    preview: Preview

    def read_kind(self, kind: str, mode: str) -> Pixels | None:
        layer = next((layer for layers in self.manifest.passes for layer in layers if layer.kind == kind), None)
        return None if layer is None else self.read(layer, mode)

    def read(self, layer: Layer, mode: str) -> Pixels | None:
        """Returns the pixels of a layer, (H, W) or (H, W, C); None if no tile is stored. Nothing is 0, or 255 in grey layers."""
        left, top, width, height = self.preview.window
        origin_x, origin_y, side = round(left), round(top), self.manifest.tile_px
        number = next(number for number, layers in enumerate(self.manifest.passes) if layer in layers)
        drawn = False
        with (
            Image.new(mode, (round(width), round(height)), 255 if mode == "L" else 0) as window,
            open_track(self.workspace, self.record, track_id(self.preview.view, number)) as store,
        ):
            for tile in self.preview.tiles:
                data = store.get_tile(store.shape.layer_number(layer.name), *tile)
                if data is not None:
                    window.paste(
                        _decode(data, mode, f"{self.preview.view}/{layer.name}", tile, store.url),
                        (tile.x * side - origin_x, tile.y * side - origin_y),
                    )
                    drawn = True
            return np.array(window) if drawn else None


def _decode(data: bytes, mode: str, path: str, tile: TileId, url: str) -> Image.Image:
    try:
        with Image.open(io.BytesIO(data)) as image:
            return image.convert(mode)
    except OSError as error:
        raise Corrupt(f"{url}: tile {path}/{tile.z}/{tile.x}/{tile.y} is not an image: {error}; run: map3d verify") from error
