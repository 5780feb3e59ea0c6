"""A tracer without geometry: the signature of the core's cameras and views, with arrays that are easy to predict, and faults."""

import os
import time
from typing import Any

import numpy as np

from map3d.portrayal import nearby, view_tracer

SLOW_PX, CRASH_PX, STUCK_PX = 401, 402, 403
"""Widths of views that take a while, that kill the subprocess, and that never end."""


class FakeCamera:
    def __init__(self, projection, position, right, up, forward, window, near_m, far_m, width_px, height_px) -> None:
        self.width_px, self.height_px, self.window, self.position = width_px, height_px, window, position


class FakeScene:
    """Left half: object 2 at a depth of 50 m, colour red, half covered; right half: nothing."""

    def __init__(self, folder: str, cache_bytes: int = 0) -> None:
        self.folder = folder

    def render_view(self, camera, layers, *, samples=16, threads=1, deadline_s=None, box=None, objects=None, region=None) -> dict[str, Any]:
        if camera.width_px == CRASH_PX:
            os.abort()
        while camera.width_px == STUCK_PX:
            time.sleep(0.05)
        if camera.width_px == SLOW_PX:
            time.sleep(0.2)
        shape = (camera.height_px, camera.width_px)
        left = np.zeros(shape, bool)
        left[:, : camera.width_px // 2 + 1] = objects is None or 2 in objects
        arrays = {
            "color": np.where(left[..., None], np.array([200, 0, 0, 128], np.uint8), np.uint8(0)),
            "normal": np.where(left[..., None], np.array([128, 64, 255], np.uint8), np.uint8(0)),
            "id": np.where(left, np.uint32(2), np.uint32(0)),
            "depth": np.where(left, np.float32(50), np.float32("nan")),
            "ao": np.where(left, np.uint8(100), np.uint8(255)),
            "sun": np.where(left, np.uint8(0), np.uint8(255)),
        }
        return {layer.kind: arrays[layer.kind] for layer in layers}

    def pick_ray(self, camera, x_px, y_px, count=1, *, box=None, objects=None) -> list[tuple[int, float, list[float], list[float]]]:
        hits = [(2, 50.0, [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), (1, 60.0, [0.0, 0.0, 0.0], [0.0, 0.0, 1.0])] if x_px < camera.width_px / 2 else []
        return [hit for hit in hits if objects is None or hit[0] in objects][:count]


class FakeCore:
    Camera, Scene, LayerSpec = FakeCamera, FakeScene, view_tracer._core.LayerSpec


def open_fake(setup):
    view_tracer._core = nearby._core = FakeCore
    return view_tracer.open_tracer(setup)
