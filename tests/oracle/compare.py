"""Figures of agreement between two images of a tile."""

import numpy as np
from numpy.typing import NDArray


def srgb_from_linear(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)


def psnr(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Returns the PSNR in decibels of values in 0..1."""
    return float(-10 * np.log10(max(np.mean((a - b) ** 2), 1e-12)))


def gradient_energy(image: NDArray[np.float64]) -> float:
    """Returns the mean squared difference of neighbouring pixels, a measure of sharpness."""
    return float(np.mean(np.diff(image, axis=0) ** 2) + np.mean(np.diff(image, axis=1) ** 2))


def edges(ids: NDArray[np.uint32], normal: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(H, W): within one pixel of a change of object, of normal (more than 2.5°), of surface, or of the tile's border."""
    seen = np.where(np.isfinite(depth), depth, 1e9)
    change = np.zeros(ids.shape, bool)
    for axis in (0, 1):
        here, there = _pairs(axis)
        differs = (ids[here] != ids[there]) | ((normal[here] * normal[there]).sum(-1) < 0.999)
        step = np.diff(seen, axis=axis)
        bend = np.abs(np.diff(step, axis=axis)) > 0.02
        change[here] |= differs
        change[there] |= differs
        inner = [slice(None), slice(None)]
        inner[axis] = slice(1, -1)
        change[tuple(inner)] |= bend
    wide = np.pad(change, 1, constant_values=True)
    grown = np.zeros_like(wide)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            grown |= np.roll(wide, (dy, dx), (0, 1))
    return grown[1:-1, 1:-1]


def _pairs(axis: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    here, there = [slice(None), slice(None)], [slice(None), slice(None)]
    here[axis], there[axis] = slice(None, -1), slice(1, None)
    return tuple(here), tuple(there)
