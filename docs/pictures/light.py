"""Shows light layers side by side, read from a tile store."""

import io
from pathlib import Path
from typing import Final

from PIL import Image
from sheet import sheet

from map3d.tiles.sqlite_store import SqliteTileStore

PANELS: Final = ("picture", "sun", "ao")
SIZE_PX: Final = (500, 620)
QUALITY: Final = 88


def side_by_side(store: SqliteTileStore, middle_px: tuple[int, int], out: Path) -> None:
    """Makes a JPEG of all panels around a pixel of level zmax, counted from the top left corner of the square."""
    left_px, top_px = (at - side // 2 for at, side in zip(middle_px, SIZE_PX, strict=True))
    sheet([_cut(store, name, left_px, top_px) for name in PANELS]).save(out, quality=QUALITY)


def _cut(store: SqliteTileStore, name: str, left_px: int, top_px: int) -> Image.Image:
    """Returns a rectangle of a layer's pixels of level zmax."""
    shape = store.shape
    layer = next(number for number, layer in enumerate(shape.layers) if layer.name == name)
    cut = Image.new("RGB", SIZE_PX, "white")
    side = shape.tile_px
    for x in range(left_px // side, (left_px + SIZE_PX[0]) // side + 1):
        for y in range(top_px // side, (top_px + SIZE_PX[1]) // side + 1):
            data = store.get_tile(layer, shape.zmax, x, y)
            if data is not None:
                tile = Image.open(io.BytesIO(data)).convert("RGB")
                cut.paste(tile, (x * side - left_px, y * side - top_px))
    return cut
