"""Writes images of any size as JPEG in a tiled GeoTIFF, tile by tile: a classic TIFF up to 4.2 GB, a BigTIFF above that.

GDAL writes such files too, but some of its builds compress five times slower than Pillow, and it must choose between the two in advance.
"""

import io
import struct
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from PIL import Image

from map3d_town.textures.noise_patterns import PackedImage

TILE_PX = 512
QUALITY = 88
CLASSIC_BYTES = 4_200_000_000
HEADER_BYTES = 16
SHORT, LONG, DOUBLE, UNDEFINED, LONG8 = 3, 4, 12, 7, 16
CODES = {SHORT: "H", LONG: "I", DOUBLE: "d", UNDEFINED: "B", LONG8: "Q"}
Tag = tuple[int, int, Sequence[float]]


class JpegTiff:
    """A writer of a square GeoTIFF of `side_px`. `epsg`: code of a projected CRS in metres; (west, north): outer corner of pixel (0, 0)."""

    def __init__(self, path: Path, side_px: int, px_m: float, epsg: int, west: float, north: float) -> None:
        self.side_px, self.across = side_px, -(-side_px // TILE_PX)
        self.georeference = (px_m, epsg, west, north)
        self.offsets, self.sizes = np.zeros((2, self.across * self.across), dtype=np.int64)
        self.out = path.open("wb")

    def __enter__(self) -> Self:
        self.out.write(bytes(HEADER_BYTES))
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        with self.out:
            if error is None:
                self._finish()

    def write(self, x: int, y: int, picture: PackedImage) -> None:
        """Writes a packed image at (x, y), multiples of the tile side. It must fill whole tiles, except at the right and lower edges."""
        for j in range(0, picture.shape[0], TILE_PX):
            for i in range(0, picture.shape[1], TILE_PX):
                tile = picture[j : j + TILE_PX, i : i + TILE_PX]
                data = _encode_jpeg(_pad_tile(tile), 2)
                number = (y + j) // TILE_PX * self.across + (x + i) // TILE_PX
                self.offsets[number], self.sizes[number] = self.out.tell(), len(data)
                self.out.write(data)

    def _finish(self) -> None:
        """Writes the directory after the tiles, then the header."""
        self.out.write(bytes(self.out.tell() % 2))
        start = self.out.tell()
        wide = start > CLASSIC_BYTES
        self.out.write(_encode_directory(self._make_tags(wide), start, wide))
        self.out.seek(0)
        self.out.write(struct.pack("<2sHHHQ", b"II", 43, 8, 0, start) if wide else struct.pack("<2sHI8x", b"II", 42, start))

    def _make_tags(self, wide: bool) -> list[Tag]:
        px_m, epsg, west, north = self.georeference
        keys = (1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, epsg)
        return [
            (256, LONG, [self.side_px]),
            (257, LONG, [self.side_px]),
            (258, SHORT, [8, 8, 8]),
            (259, SHORT, [7]),
            (262, SHORT, [6]),
            (277, SHORT, [3]),
            (284, SHORT, [1]),
            (322, SHORT, [TILE_PX]),
            (323, SHORT, [TILE_PX]),
            (324, LONG8 if wide else LONG, self.offsets.tolist()),
            (325, LONG, self.sizes.tolist()),
            (339, SHORT, [1, 1, 1]),
            (347, UNDEFINED, list(_encode_jpeg(np.zeros((16, 16), dtype="<u4"), 1))),
            (530, SHORT, [2, 2]),
            (33550, DOUBLE, [px_m, px_m, 0.0]),
            (33922, DOUBLE, [0.0, 0.0, 0.0, west, north, 0.0]),
            (34735, SHORT, keys),
        ]


def _pad_tile(tile: PackedImage) -> PackedImage:
    """Extends a tile to full size by repeating its last row and column."""
    missing = [(0, TILE_PX - side) for side in tile.shape]
    return np.pad(tile, missing, mode="edge") if tile.shape != (TILE_PX, TILE_PX) else np.ascontiguousarray(tile)


def _encode_jpeg(picture: PackedImage, streamtype: int) -> bytes:
    """Encodes with 4:2:0 subsampling; `streamtype` 1: only the tables that all tiles share, 2: a tile without them."""
    height, width = picture.shape
    image = Image.frombuffer("RGBX", (width, height), picture, "raw", "RGBX", 0, 1)
    buffer = io.BytesIO()
    image.save(buffer, "JPEG", quality=QUALITY, subsampling=2, streamtype=streamtype)
    return buffer.getvalue()


def encoded_tile_bytes(picture: PackedImage) -> int:
    """Returns the encoded size of a tile."""
    return len(_encode_jpeg(_pad_tile(picture), 2))


def _encode_directory(tags: Sequence[Tag], start: int, wide: bool) -> bytes:
    """Encodes the image file directory at byte `start`, followed by the values that do not fit into its entries."""
    count, entry, room, unit = ("<Q", "<HHQ", 8, 20) if wide else ("<H", "<HHI", 4, 12)
    after = start + struct.calcsize(count) + unit * len(tags) + room
    table, values = struct.pack(count, len(tags)), b""
    for number, kind, numbers in tags:
        data = struct.pack(f"<{len(numbers)}{CODES[kind]}", *numbers)
        table += struct.pack(entry, number, kind, len(numbers))
        if len(data) <= room:
            table += data.ljust(room, b"\0")
            continue
        table += struct.pack("<Q" if wide else "<I", after + len(values))
        values += data + bytes(len(data) % 2)
    return table + bytes(room) + values


__all__ = ["TILE_PX", "JpegTiff", "encoded_tile_bytes"]
