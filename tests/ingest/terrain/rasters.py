"""Small test rasters, and a writer that records its meshes."""

import json
import warnings

import numpy as np
import rasterio
from affine import Affine

WEST, NORTH = 691000.0, 5336000.0


def write(path, data, pixel_m=1.0, crs="EPSG:25832", transform=None, **profile):
    """`data`: (bands, rows, columns)."""
    transform = transform or Affine(pixel_m, 0, WEST, 0, -pixel_m, NORTH)
    shape = {"count": data.shape[0], "height": data.shape[1], "width": data.shape[2], "dtype": data.dtype}
    interp = profile.pop("colorinterp", None)
    units = profile.pop("units", None)
    scales = profile.pop("scales", None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(path, "w", driver="GTiff", crs=crs, transform=transform, **shape, **profile) as raster:
            raster.write(data)
            if interp:
                raster.colorinterp = interp
            if units:
                raster.units = units
            if scales:
                raster.scales = scales
    return path


def from_bounds(west, south, east, north, columns, rows):
    return Affine((east - west) / columns, 0, west, 0, (south - north) / rows, north)


def pixel_of(transform, x, y):
    """Returns the (column, row) of the pixel that contains (x, y)."""
    a, b, c, d, e, f = (~transform)[:6]
    return int(a * x + b * y + c), int(d * x + e * y + f)


def hills(rows, columns):
    """Returns (1, rows, columns) float32 heights."""
    y, x = np.mgrid[0:rows, 0:columns]
    return (20 * np.sin(x / 7) * np.cos(y / 5) + 0.1 * x)[None].astype(np.float32)


def colours(rows, columns):
    """Returns (3, rows, columns) uint8: red encodes the column, green the row."""
    y, x = np.mgrid[0:rows, 0:columns]
    return np.stack([x * 255 // max(columns - 1, 1), y * 255 // max(rows - 1, 1), np.full_like(x, 128)]).astype(np.uint8)


class RecordingWriter:
    """Replaces the core's AssetWriter."""

    def __init__(self):
        self.meshes, self.materials, self.objects, self.finished = [], None, None, False

    def append_mesh(self, positions, triangles, uvs, material, object, rank):
        assert positions.dtype == np.float64
        assert positions.shape[1] == 3
        assert triangles.dtype == np.uint32
        assert triangles.shape[1] == 3
        assert np.isfinite(positions).all()
        assert triangles.max() < len(positions)
        assert uvs is None or (uvs.dtype == np.float32 and uvs.shape == (len(triangles), 3, 2))
        self.meshes.append((positions, triangles, uvs, material, object, rank))

    def set_tables(self, materials, objects):
        self.materials, self.objects = json.loads(materials)["materials"], json.loads(objects)

    def finish(self, reader):
        assert reader is None
        self.finished = True
        return json.dumps({"format": "?", "objects": len(self.objects), "triangles": self.triangle_count, "findings": []})

    @property
    def triangle_count(self):
        return sum(len(mesh[1]) for mesh in self.meshes)

    def soup(self):
        """Returns the (t, 3, 3) corners of all triangles."""
        return np.concatenate([positions[triangles] for positions, triangles, *_ in self.meshes])
