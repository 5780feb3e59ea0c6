"""Cuts texture tiles from an orthophoto, window by window: 8-bit RGB. Gaps get the ground colour or become transparent."""

import io
import threading
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rasterio.enums import ColorInterp, MaskFlags, Resampling
from rasterio.windows import Window

from map3d.ingest.terrain.damaged_reads import Damage, read_checked, read_mask, read_parts
from map3d.ingest.terrain.photo_margin import PhotoMargin
from map3d.ingest.terrain.photo_values import ValueRange, find_colour_bands, find_range, is_whole, sample_values, significant_bits
from map3d.ingest.terrain.stored_blocks import StoredBlocks

MARGIN_PX: Final = 8
ALIGN_PX: Final = 8
EXTEND_PX: Final = MARGIN_PX + ALIGN_PX
"""Distance by which colours extend into gaps, so that filtering at the edge of a gap does not mix in the ground colour."""

JPEG_QUALITY: Final = 90
PLAIN_PX: Final = 8
Colours = NDArray[np.uint8]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class TextureTile:
    """A texture image in its photo: the upper left corner is at photo position (left, top); `scale` is image pixels per photo pixel (x, y).
    `key` is the digest of the file; `cutout`: it has transparent pixels."""

    key: str
    left: int
    top: int
    scale: tuple[float, float]
    size_px: tuple[int, int]
    cutout: bool

    @property
    def file_name(self) -> str:
        return f"{self.key}.{'png' if self.cutout else 'jpg'}"

    def uvs(self, columns: NDArray[np.float64], rows: NDArray[np.float64]) -> NDArray[np.float32]:
        """Returns (n, 2) texture coordinates of photo positions: (0, 0) is the lower left corner, texel centres are at (i + ½)/size."""
        u = (columns - self.left) * self.scale[0] / self.size_px[0]
        v = 1.0 - (rows - self.top) * self.scale[1] / self.size_px[1]
        return np.stack([u, v], axis=-1).astype(np.float32)


class Orthophoto:
    """Colours of an open raster. `value_range`: the values mapped to 0 and 255; None derives them from data type and data."""

    def __init__(
        self,
        dataset: Any,
        ground: tuple[int, int, int],
        max_side_px: int,
        value_range: ValueRange | None = None,
        margin: PhotoMargin | None = None,
        damage: Damage | None = None,
        name: str = "",
    ) -> None:
        """`margin`: the one of the photo that is transparent; `damage` gets the `name` of a photo that cannot be read as a whole."""
        self.dataset = dataset
        self._ground = np.array(ground, dtype=np.uint8)
        self._max_side_px = max_side_px
        self._margin, self._damage, self._name = margin, damage or Damage(strict=True), name or str(dataset.name)
        self._bands = find_colour_bands(dataset)
        self._blocks = StoredBlocks(dataset, self._bands)
        self._has_no_gaps = all(flags == [MaskFlags.all_valid] for flags in dataset.mask_flag_enums)
        self._palette = _read_palette(dataset) if len(self._bands) == 1 else None
        self.value_range = ValueRange() if self._palette is not None else value_range or self._find_range()

    @property
    def stretch(self) -> tuple[float, float]:
        return self.value_range.stretch

    def cut(self, box: tuple[float, float, float, float], folder: Path, *, cutout: bool) -> TextureTile | None:
        """Writes the texture of photo positions (left, top, right, bottom) into `folder`; returns None if the photo has no pixel there.

        `cutout`: gaps become transparent; otherwise they get the ground colour. Near photo pixels, gaps get the colour of the nearest one. A texture
        of one colour has PLAIN_PX texels along a side.
        """
        left, top, right, bottom = _align(box)
        width, height = self._image_side(right - left), self._image_side(bottom - top)
        colour, covered = self._read(left, top, right - left, bottom - top, width, height)
        if not covered.any():
            return None
        transparent = cutout and not covered.all()
        if not transparent and (colour == colour[0, 0]).all():
            colour = colour[:PLAIN_PX, :PLAIN_PX]
            height, width = colour.shape[:2]
        data = _encode_png(colour, covered) if transparent else _encode_jpeg(colour)
        key = sha256(data).hexdigest()[:32]
        tile = TextureTile(key, left, top, (width / (right - left), height / (bottom - top)), (width, height), transparent)
        _write_image(folder / tile.file_name, data)
        return tile

    def _image_side(self, pixels: int) -> int:
        return min(pixels, self._max_side_px)

    def _read(self, left: int, top: int, width: int, height: int, out_width: int, out_height: int) -> tuple[Colours, Mask]:
        """Returns (h, w, 3) colours of a window and the (h, w) mask of covered pixels. Outside the photo, edge pixels repeat and count as covered."""
        x0, y0 = max(left, 0), max(top, 0)
        x1, y1 = min(left + width, self.dataset.width), min(top + height, self.dataset.height)
        nothing = np.zeros((out_height, out_width, 3), dtype=np.uint8), np.zeros((out_height, out_width), dtype=bool)
        if x0 >= x1 or y0 >= y1:
            return nothing
        columns = _to_image_pixels(x0 - left, x1 - left, out_width / width, out_width)
        rows = _to_image_pixels(y0 - top, y1 - top, out_height / height, out_height)
        colour, covered = self._read_inside(Window(x0, y0, x1 - x0, y1 - y0), len(rows), len(columns))
        if not covered.any():
            return nothing
        return _pad(_fill_gaps(colour, covered, self._ground), covered, rows, columns, (out_height, out_width), self._ground)

    def _read_inside(self, window: Window, rows: int, columns: int) -> tuple[Colours, Mask]:
        colour, covered = np.zeros((rows, columns, 3), dtype=np.uint8), np.zeros((rows, columns), dtype=bool)
        stored = self._blocks.mask(window, rows, columns)
        if stored is not None and not stored.any():
            return colour, covered
        block_rows = max(height for height, _ in self.dataset.block_shapes)
        read, failed = partial(self._read_rows, columns=columns), partial(self._damage.add, self._name)
        for part, (part_colour, part_covered) in read_parts(window, rows, block_rows, read, failed):
            colour[part], covered[part] = part_colour, part_covered
        if stored is not None:
            covered &= stored
        return colour, covered

    def _read_rows(self, window: Window, rows: int, columns: int) -> tuple[Colours, Mask]:
        resampling = Resampling.nearest if self._palette is not None else Resampling.average
        data = read_checked(self.dataset, self._bands, window=window, out_shape=(len(self._bands), rows, columns), resampling=resampling)
        mask = None if self._has_no_gaps else read_mask(self.dataset, window=window, out_shape=(rows, columns), resampling=Resampling.nearest)
        covered = np.ones((rows, columns), dtype=bool) if mask is None else mask > 0
        if data.dtype.kind == "f":
            covered &= np.isfinite(data).all(axis=0)
        if self._margin is not None:
            covered &= ~self._margin.find(window, data)
        return np.moveaxis(self._to_bytes(data), 0, -1), covered

    def _to_bytes(self, data: NDArray[Any]) -> Colours:
        """Returns (3, h, w)."""
        if self._palette is not None:
            return np.ascontiguousarray(np.moveaxis(self._palette[np.clip(data[0], 0, len(self._palette) - 1).astype(np.intp)], -1, 0))
        low, high = self.stretch
        if data.dtype != np.uint8 or (low, high) != (0.0, 255.0):
            with np.errstate(invalid="ignore", over="ignore"):
                scaled = (data.astype(np.float64) - low) * (255.0 / (high - low))
            data = np.clip(np.nan_to_num(scaled, nan=0.0) + 0.5, 0, 255).astype(np.uint8)
        return data if len(data) == 3 else np.repeat(data[:1], 3, axis=0)

    def _find_range(self) -> ValueRange:
        """Returns the full range for bytes, otherwise a range that the file or its values suggest."""
        values = sample_values(self.dataset, 1)
        if values is None:
            return ValueRange()
        return find_range(values, bits=significant_bits(self.dataset, self._bands), whole_numbers=is_whole(self.dataset, self._bands))


def _read_palette(dataset: Any) -> Colours | None:
    if dataset.colorinterp[0] is not ColorInterp.palette:
        return None
    entries = dataset.colormap(1)
    return np.array([entries.get(number, (0, 0, 0, 0))[:3] for number in range(max(entries) + 1)], dtype=np.uint8)


def _align(box: tuple[float, float, float, float]) -> tuple[int, int, int, int]:
    """Adds a margin, so that filtering near a tile's border reads the neighbour's pixels, and rounds to whole JPEG blocks."""
    left, top = (int((value - MARGIN_PX) // ALIGN_PX) * ALIGN_PX for value in box[:2])
    right, bottom = (-int((-value - MARGIN_PX) // ALIGN_PX) * ALIGN_PX for value in box[2:])
    return left, top, right, bottom


def _fill_gaps(colour: Colours, covered: Mask, ground: Colours) -> Colours:
    """Gives each gap texel the colour of the nearest covered one in its row, else in its column, within EXTEND_PX; else the ground colour."""
    if covered.all():
        return colour
    out, known = colour.copy(), covered.copy()
    for flip in (False, True):
        image, have = (out.swapaxes(0, 1), known.swapaxes(0, 1)) if flip else (out, known)
        nearest = _find_nearest_in_row(have)
        take = ~have & (nearest >= 0)
        image[take] = image[np.nonzero(take)[0], nearest[take]]
        have |= take
    out[~known] = ground
    return out


def _find_nearest_in_row(have: Mask) -> NDArray[np.int32]:
    """Returns the (h, w) column of the nearest true pixel in the row, -1 beyond EXTEND_PX."""
    columns = np.arange(have.shape[1], dtype=np.int32)
    far = np.int32(1 << 24)
    before = np.maximum.accumulate(np.where(have, columns, -far), axis=1)
    after = np.minimum.accumulate(np.where(have, columns, far)[:, ::-1], axis=1)[:, ::-1]
    nearest = np.where(columns - before <= after - columns, before, after)
    return np.where(np.abs(nearest - columns) <= EXTEND_PX, nearest, np.int32(-1)).astype(np.int32)


def _to_image_pixels(first: int, last: int, scale: float, count: int) -> range:
    """Returns the image pixels of photo pixels [first, last), at least one."""
    begin = min(round(first * scale), count - 1)
    return range(begin, min(max(round(last * scale), begin + 1), count))


def _pad(colour: Colours, covered: Mask, rows: range, columns: range, shape: tuple[int, int], ground: Colours) -> tuple[Colours, Mask]:
    """Puts the colours at `rows` and `columns` of an image of `shape`, repeats their edge for EXTEND_PX, and fills the rest with ground colour."""
    if colour.shape[:2] == shape:
        return colour, covered
    spans = zip((rows, columns), shape, strict=True)
    row_of, column_of = (np.clip(np.arange(count), span.start, span.stop - 1) - span.start for span, count in spans)
    padded, far = colour[row_of][:, column_of], np.ones(shape, dtype=bool)
    far[max(rows.start - EXTEND_PX, 0) : rows.stop + EXTEND_PX, max(columns.start - EXTEND_PX, 0) : columns.stop + EXTEND_PX] = False
    padded[far] = ground
    known = np.ones(shape, dtype=bool) if covered.any() else np.zeros(shape, dtype=bool)
    known[rows.start : rows.stop, columns.start : columns.stop] = covered
    return padded, known


def _write_image(path: Path, data: bytes) -> None:
    """Writes a file named after its content, in one step: other threads may write the same."""
    draft = path.with_name(f"{path.name}.{threading.get_ident()}.new")
    draft.write_bytes(data)
    draft.replace(path)


def _encode_jpeg(colour: Colours) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(colour, "RGB").save(stream, "JPEG", quality=JPEG_QUALITY)
    return stream.getvalue()


def _encode_png(colour: Colours, covered: Mask) -> bytes:
    stream = io.BytesIO()
    alpha = np.where(covered, 255, 0).astype(np.uint8)[..., None]
    Image.fromarray(np.concatenate([colour, alpha], axis=-1), "RGBA").save(stream, "PNG", compress_level=6)
    return stream.getvalue()
