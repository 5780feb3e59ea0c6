"""The cameras of map3d's core as Mitsuba's sensors."""

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from map3d import _core

from .mitsuba_scene import MitsubaScene, PixelHits

INTEGRATOR = "albedo:albedo,depth:depth,normal:sh_normal,triangle:prim_index"


def look(
    kind: str, position: NDArray[np.float64], forward: tuple[float, float, float], roll_deg: float, half: float, size: tuple[int, int]
) -> _core.Camera:
    """Returns a camera with a window that reaches `half` to both sides."""
    ahead = np.array(forward) / np.linalg.norm(forward)
    side = np.cross(ahead, (0, 0, 1) if abs(ahead[2]) < 0.999 else (0, 1, 0))
    side /= np.linalg.norm(side)
    c, s = np.cos(np.radians(roll_deg)), np.sin(np.radians(roll_deg))
    right = c * side + s * np.cross(side, ahead)
    high = half * size[1] / size[0]
    up = np.cross(right, ahead)
    kind_ = "perspective" if kind == "perspective" else "orthographic"
    vectors = [tuple(v.tolist()) for v in (position, right, up, ahead)]
    return _core.Camera(kind_, *vectors, (-half, half, -high, high), 0.5, 20_000.0, *size)  # type: ignore[arg-type]


class CameraViews:
    """Views of a Mitsuba scene. The cameras' windows must be symmetrical and their pixels square."""

    def __init__(self, scene: MitsubaScene) -> None:
        self._scene = scene
        self.ids = np.unique(scene.ids)
        self._integrator = mi.load_dict({"type": "aov", "aovs": INTEGRATOR})

    def hits(self, view: _core.Camera) -> PixelHits:
        sensor = self.sensor(view, 1)
        width, height = view.width_px, view.height_px
        across, down = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        ray, _ = sensor.sample_ray(0.0, 0.5, mi.Point2f(across.ravel(), down.ravel()), mi.Point2f(0.5, 0.5))
        scene = self._scene.scene
        si = scene.ray_intersect(ray)
        valid = np.array(si.is_valid())
        point, forward = np.array(si.p).T.astype(np.float64), np.array(view.forward)
        depth = np.where(valid, (point - np.array(view.position)) @ forward, np.inf)
        normal = np.array(si.n).T.astype(np.float64)
        normal *= -np.sign((normal * np.array(ray.d).T).sum(-1))[:, None]
        triangle = np.array(si.shape.eval_attribute_1("face_triangle", si)).round().astype(np.int64)
        beyond = scene.ray_intersect(mi.Ray3f(ray.o + ray.d * (si.t + 1e-3), ray.d))
        second = np.where(np.array(beyond.is_valid()), np.array(beyond.t) + 1e-3, np.inf)
        ids = np.where(valid, self._scene.ids[np.clip(triangle, 0, len(self._scene.ids) - 1)], 0).astype(np.uint32)
        shape = (height, width)
        return PixelHits(depth.reshape(shape), normal.reshape(*shape, 3), ids.reshape(shape), second.reshape(shape))

    def albedo(self, view: _core.Camera, samples: int) -> NDArray[np.float64]:
        """Returns (H, W, 3) linear light, averaged over each pixel's box; 0 without hit."""
        integrator = mi.load_dict({"type": "aov", "aovs": "albedo:albedo"})
        rounds = max(1, samples // 128)
        images = [
            np.array(mi.render(self._scene.scene, sensor=self.sensor(view, samples // rounds), integrator=integrator, seed=seed))
            for seed in range(rounds)
        ]
        return np.mean(images, axis=0).astype(np.float64)[..., -3:]

    def layers(self, view: _core.Camera, samples: int) -> NDArray[np.float32]:
        """Returns albedo, depth, normal and triangle in one rendering; for timing."""
        return np.array(mi.render(self._scene.scene, sensor=self.sensor(view, samples), integrator=self._integrator, seed=0))

    def sensor(self, view: _core.Camera, samples: int) -> Any:
        right, up, forward, position = (np.array(v) for v in (view.right, view.up, view.forward, view.position))
        half = view.window[1]
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = -right, up, forward, position
        camera: dict[str, Any] = {"type": "perspective", "fov": float(np.degrees(2 * np.arctan(half))), "fov_axis": "x"}
        if view.projection == "orthographic":
            # The film spans [-1, 1] across, and with square pixels less down.
            matrix[:3, 0] *= half
            matrix[:3, 1] *= half
            camera = {"type": "orthographic"}
        film = {"type": "hdrfilm", "width": view.width_px, "height": view.height_px, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
        near = {"near_clip": max(view.near_m, 1e-3), "far_clip": view.far_m}
        sampler = {"type": "independent", "sample_count": samples}
        return mi.load_dict({**camera, "to_world": mi.ScalarTransform4f(matrix), **near, "film": film, "sampler": sampler})
