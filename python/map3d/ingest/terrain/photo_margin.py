"""Margins without a picture of photos that declare no gaps: black or white pixels that reach the edge, as those around a photo that was turned."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rasterio.enums import ColorInterp, MaskFlags, Resampling
from rasterio.windows import Window

from map3d.ingest.terrain.damaged_reads import READ_ERRORS, read_checked, read_mask
from map3d.ingest.terrain.photo_values import find_colour_bands

CELLS: Final = 512
"""Greatest number of cells along a side of the grid that says where the margin is."""
LEAST_SHARE: Final = 0.2
"""Share of the photo's edge that a margin takes at least."""
WHOLE: Final = 0.98
"""A photo of which margins take more than this is one of a black or white place."""
LOSSY_STEPS: Final = 12
"""How far, of 255, pixels of a margin may be from black or white in a lossy format."""
_LOSSY: Final = ("jpeg", "ycbcr jpeg", "webp", "jxl", "lerc")
_LOSSY_DRIVERS: Final = ("JPEG", "JP2OpenJPEG", "WarpedVRT", "VRT")

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class PhotoMargin:
    """`cells`: (rows, columns), where pixels of the `colour`, up to `tolerance`, are the margin; `cell_px`: height and width of a cell."""

    cells: Mask
    cell_px: tuple[float, float]
    colour: float
    tolerance: float

    @property
    def name(self) -> str:
        return "white" if self.colour else "black"

    def find(self, window: Window, data: NDArray[Any]) -> Mask:
        """Returns the (h, w) mask of the margin in a window that was read as (bands, h, w). Pixels that mix with it belong to it."""
        rows, columns = data.shape[1:]
        row = _cell_of(window.row_off, window.height, rows, self.cell_px[0], self.cells.shape[0])
        column = _cell_of(window.col_off, window.width, columns, self.cell_px[1], self.cells.shape[1])
        near = self.cells[np.ix_(row, column)]
        if not near.any():
            return near
        found = near & _is_colour(data, self.colour, self.tolerance)
        is_mixed = self.tolerance > 0 or rows < window.height or columns < window.width
        return near & _grown(found) if is_mixed else found


class PhotoMargins:
    """The margins of the photos of a terrain, for all threads: each is found once."""

    def __init__(self) -> None:
        self._found: dict[Path, PhotoMargin | None] = {}

    def of(self, path: Path, dataset: Any, source: Any) -> PhotoMargin | None:
        """Returns the margin of the photo at a path; the other arguments are those of `find_margin`."""
        if path not in self._found:
            self._found[path] = find_margin(dataset, source)
        return self._found[path]


def find_margin(dataset: Any, source: Any) -> PhotoMargin | None:
    """Returns the margin of a photo of whole numbers without declared gaps; None for others. `dataset`: the photo as it is read, perhaps resampled
    from its `source`. What cannot be read has no margin."""
    bands = find_colour_bands(source)
    has_gaps = source.nodata is not None or any(flags != [MaskFlags.all_valid] for flags in source.mask_flag_enums)
    if has_gaps or source.colorinterp[0] is ColorInterp.palette or source.dtypes[bands[0] - 1] not in ("uint8", "uint16"):
        return None
    try:
        found = [_find(source, bands, colour) for colour in _corner_colours(source, bands)]
        margin = next((margin for margin in found if margin is not None), None)
        return margin if margin is None or dataset is source else _find(dataset, bands, margin.colour, resampled=True)
    except READ_ERRORS:
        return None


def _corner_colours(dataset: Any, bands: list[int]) -> list[float]:
    """Returns black and white as far as a corner has them."""
    corners = [Window(column, row, 1, 1) for row in (0, dataset.height - 1) for column in (0, dataset.width - 1)]
    pixels = [read_checked(dataset, bands, window=corner) for corner in corners]
    colours, tolerance = (0.0, float(np.iinfo(pixels[0].dtype).max)), _tolerance(dataset)
    return [colour for colour in colours if any(_is_colour(pixel, colour, tolerance).all() for pixel in pixels)]


def _tolerance(dataset: Any) -> float:
    compression = str(dataset.profile.get("compress", "")).lower()
    if compression not in _LOSSY and dataset.driver not in _LOSSY_DRIVERS:
        return 0.0
    return LOSSY_STEPS * float(np.iinfo(dataset.dtypes[0]).max) / 255.0


def _find(dataset: Any, bands: list[int], colour: float, *, resampled: bool = False) -> PhotoMargin | None:
    """Samples a pixel of each cell, and the edge; cells of the colour that reach a corner are the margin."""
    shape = (min(dataset.height, CELLS), min(dataset.width, CELLS))
    tolerance = LOSSY_STEPS * float(np.iinfo(dataset.dtypes[0]).max) / 255.0 if resampled else _tolerance(dataset)
    candidate = _sample(dataset, bands, Window(0, 0, dataset.width, dataset.height), shape, colour, tolerance)
    if resampled:
        candidate[np.asarray(read_mask(dataset, out_shape=shape, resampling=Resampling.nearest)) == 0] = True
    for row, at in ((0, 0), (-1, dataset.height - 1)):
        candidate[row, :] |= _sample(dataset, bands, Window(0, at, dataset.width, 1), (1, shape[1]), colour, tolerance)[0]
    for column, at in ((0, 0), (-1, dataset.width - 1)):
        candidate[:, column] |= _sample(dataset, bands, Window(at, 0, 1, dataset.height), (shape[0], 1), colour, tolerance)[:, 0]
    cells = _reached_from_corners(candidate)
    edge = np.concatenate([cells[0], cells[-1], cells[1:-1, 0], cells[1:-1, -1]])
    if not resampled and (edge.mean() < LEAST_SHARE or cells.mean() > WHOLE):
        return None
    return PhotoMargin(_grown(cells), (dataset.height / shape[0], dataset.width / shape[1]), colour, tolerance)


def _sample(dataset: Any, bands: list[int], window: Window, shape: tuple[int, int], colour: float, tolerance: float) -> Mask:
    data = read_checked(dataset, bands, window=window, out_shape=(len(bands), *shape), resampling=Resampling.nearest)
    return _is_colour(data, colour, tolerance)


def _is_colour(data: NDArray[Any], colour: float, tolerance: float) -> Mask:
    found: Mask = np.all(np.abs(data.astype(np.float64) - colour) <= tolerance, axis=0)
    return found


def _reached_from_corners(candidate: Mask) -> Mask:
    """Returns the candidate cells that are connected to one in a corner."""
    reached = np.zeros_like(candidate)
    corners = ([0, 0, -1, -1], [0, -1, 0, -1])
    reached[corners] = candidate[corners]
    count = -1
    while count != (count := int(reached.sum())):
        reached = _grown(reached) & candidate
    return reached


def _grown(mask: Mask) -> Mask:
    """Adds the eight neighbours of each pixel."""
    grown = mask.copy()
    grown[1:] |= mask[:-1]
    grown[:-1] |= mask[1:]
    wide = grown.copy()
    wide[:, 1:] |= grown[:, :-1]
    wide[:, :-1] |= grown[:, 1:]
    return wide


def _cell_of(first: float, size: float, count: int, cell_px: float, cells: int) -> NDArray[np.intp]:
    """Returns the cell of the centre of each of `count` equal parts of `size` pixels."""
    found: NDArray[np.intp] = np.minimum((first + (np.arange(count) + 0.5) * (size / count)) // cell_px, cells - 1).astype(np.intp)
    return found
