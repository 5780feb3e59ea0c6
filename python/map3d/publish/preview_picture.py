"""The preview picture of a rendering, in the format of social networks."""

import io
from typing import Final

from PIL import Image

from map3d.catalogue import RenderingRecord, Workspace
from map3d.errors import Corrupt
from map3d.geometry.views import track_id
from map3d.renderings.track_stores import open_track
from map3d.tiles.manifest import Manifest
from map3d.tiles.preview import Preview, choose_preview

FILE: Final = "preview.jpg"
WIDTH_PX: Final = 1200
HEIGHT_PX: Final = 630
QUALITY: Final = 82
BACKGROUND: Final = (242, 240, 235)
"""Colour of the viewer's page around the model."""


def make_preview(workspace: Workspace, record: RenderingRecord, manifest: Manifest) -> bytes | None:
    """Returns a JPEG that shows what the rendering contains; None while no tile of a colour layer is stored. Raises Corrupt, StoreError."""
    chosen = choose_preview(manifest, aspect=WIDTH_PX / HEIGHT_PX, min_width_px=WIDTH_PX)
    if chosen is None:
        return None
    with Image.new("RGB", (WIDTH_PX, HEIGHT_PX), BACKGROUND) as picture:
        if not _draw(picture, workspace, record, manifest, chosen):
            return None
        data = io.BytesIO()
        picture.save(data, "JPEG", quality=QUALITY, optimize=True)
    return data.getvalue()


def _draw(picture: Image.Image, workspace: Workspace, record: RenderingRecord, manifest: Manifest, chosen: Preview) -> bool:
    """Pastes the tiles at their level's resolution, and scales the window to the picture. Returns whether there are any."""
    drawn = False
    left, top, width, height = chosen.window
    number = next(number for number, layers in enumerate(manifest.passes) if any(layer.name == chosen.layer for layer in layers))
    origin_x, origin_y = round(left), round(top)
    with Image.new("RGBA", (round(width), round(height))) as window, open_track(workspace, record, track_id(chosen.view, number)) as store:
        layer = store.shape.layer_number(chosen.layer)
        for at in chosen.tiles:
            data = store.get_tile(layer, *at.tile)
            if data is None:
                continue
            try:
                with Image.open(io.BytesIO(data)) as tile:
                    window.paste(tile.convert("RGBA"), (at.x - origin_x, at.y - origin_y))
                    drawn = True
            except OSError as error:
                name = f"{chosen.view}/{chosen.layer}/{at.tile.z}/{at.tile.x}/{at.tile.y}"
                raise Corrupt(f"{store.url}: tile {name} is not an image: {error}; run: map3d verify") from error
        with window.resize(picture.size, Image.Resampling.LANCZOS) as scaled:
            picture.paste(scaled, mask=scaled)
    return drawn
