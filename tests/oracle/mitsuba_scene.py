"""The same triangles in Mitsuba 3, an independent renderer: depth, normal, triangle at pixel centres; albedo by many samples."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from .asset import Asset

mi.set_variant("llvm_ad_rgb")

Frame = dict
"""Fields of a `_core.Frame`: look_at_deg, pitch_deg, u0_m, v0_m, d0_m, size_m, tile_px, zmax."""


@dataclass(frozen=True)
class Hits:
    """At the pixel centres of a tile. depth (H, W) float64 metres from D0, inf where nothing; normal (H, W, 3) of the seen side; id (H, W) uint32;
    second (H, W) metres between the first surface and the next behind it."""

    depth: NDArray[np.float64]
    normal: NDArray[np.float64]
    id: NDArray[np.uint32]
    second: NDArray[np.float64]


def axes(frame: Frame) -> tuple[NDArray[np.float64], ...]:
    a, p = math.radians(frame["look_at_deg"]), math.radians(frame["pitch_deg"])
    right = np.array([math.cos(a), math.sin(a), 0])
    forward = np.array([-math.cos(p) * math.sin(a), math.cos(p) * math.cos(a), -math.sin(p)])
    return right, np.cross(right, forward), forward


class MitsubaScene:
    """assets: placed triangles only (no prototypes). texture(asset, material) → (H, W, 3) uint8 sRGB or None for the plain diffuse colour."""

    def __init__(self, assets: list[Asset], origin: NDArray[np.float64], texture: Callable[[Asset, dict], NDArray[np.uint8] | None]):
        self.triangle_ids: list[NDArray[np.uint32]] = []
        shapes: dict[str, object] = {"type": "scene"}
        count = 0
        for asset in assets:
            local = (asset.corners - origin).astype(np.float32)
            for number, material in enumerate(asset.materials):
                chosen = np.flatnonzero((asset.material == number) & (asset.prototype == 0))
                if len(chosen) == 0:
                    continue
                bsdf = _bsdf(material, texture(asset, material))
                shapes[f"m{len(shapes)}"] = _mesh(local[chosen], asset.uvs[chosen], bsdf, np.arange(count, count + len(chosen)))
                self.triangle_ids.append(asset.ids[asset.object[chosen]])
                count += len(chosen)
        self.ids = np.concatenate([np.zeros(0, np.uint32), *self.triangle_ids])
        self.scene = mi.load_dict(shapes)

    def hits(self, frame: Frame, x: int, y: int) -> Hits:
        size = frame["tile_px"]
        forward = axes(frame)[2]
        sensor = self._sensor(frame, x, y, 1)
        centres = (np.arange(size) + 0.5) / size
        across, down = np.meshgrid(centres, centres)
        ray, _ = sensor.sample_ray(0.0, 0.5, mi.Point2f(across.ravel(), down.ravel()), mi.Point2f(0.5, 0.5))
        si = self.scene.ray_intersect(ray)
        valid = np.array(si.is_valid())
        origin = np.array(ray.o).T.astype(np.float64)
        t = np.array(si.t).astype(np.float64)
        depth = np.where(valid, origin @ forward + t - frame["d0_m"], np.inf)
        normal = np.array(si.n).T.astype(np.float64)
        normal *= -np.sign(normal @ forward)[:, None]
        triangle = np.array(si.shape.eval_attribute_1("face_triangle", si)).round().astype(np.int64)
        beyond = self.scene.ray_intersect(mi.Ray3f(ray.o + ray.d * (si.t + 1e-3), ray.d))
        second = np.where(np.array(beyond.is_valid()), np.array(beyond.t) + 1e-3, np.inf)
        ids = np.where(valid, self.ids[np.clip(triangle, 0, len(self.ids) - 1)], 0).astype(np.uint32)
        shape = (size, size)
        return Hits(depth.reshape(shape), normal.reshape(*shape, 3), ids.reshape(shape), second.reshape(shape))

    def albedo(self, frame: Frame, x: int, y: int, samples: int) -> NDArray[np.float64]:
        """(H, W, 3) linear light, averaged over each pixel's box; 0 where nothing."""
        integrator = mi.load_dict({"type": "aov", "aovs": "albedo:albedo"})
        total, rounds = None, max(1, samples // 256)
        for seed in range(rounds):
            image = np.array(mi.render(self.scene, sensor=self._sensor(frame, x, y, samples // rounds), integrator=integrator, seed=seed)).astype(
                np.float64
            )
            total = image if total is None else total + image
        return total[..., -3:] / rounds

    def layers(self, frame: Frame, x: int, y: int, samples: int) -> NDArray[np.float64]:
        """Renders everything that a map3d tile contains at once: albedo, depth, normal, shape; for timing."""
        integrator = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,depth:depth,normal:sh_normal,shape:shape_index"})
        return np.array(mi.render(self.scene, sensor=self._sensor(frame, x, y, samples), integrator=integrator, seed=0))

    def _near_plane(self, frame: Frame) -> float:
        """Returns D of a plane in front of everything."""
        box = self.scene.bbox()
        lo, hi = np.array(box.min).ravel(), np.array(box.max).ravel()
        corners = np.array([[(lo, hi)[k >> a & 1][a] for a in range(3)] for k in range(8)])
        return float((corners @ axes(frame)[2]).min()) - 1.0

    def _sensor(self, frame: Frame, x: int, y: int, spp: int) -> object:
        right, up, forward = axes(frame)
        size, tile_m = frame["tile_px"], frame["size_m"] / 2 ** frame["zmax"]
        u = frame["u0_m"] + (x + 0.5) * tile_m
        v = frame["v0_m"] - (y + 0.5) * tile_m
        eye = right * u + up * v + forward * self._near_plane(frame)
        # The film spans [-1, 1]²: columns of the matrix are the camera's left, up, forward in local metres.
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = -right * tile_m / 2, up * tile_m / 2, forward, eye
        film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}, "pixel_format": "rgb", "component_format": "float32"}
        return mi.load_dict(
            {
                "type": "orthographic",
                "to_world": mi.ScalarTransform4f(matrix),
                "near_clip": 1e-3,
                "far_clip": 1e6,
                "film": film,
                "sampler": {"type": "independent", "sample_count": spp},
            }
        )


def _bsdf(material: dict, image: NDArray[np.uint8] | None) -> object:
    if image is None:
        color = {"type": "rgb", "value": _linear(np.array(material["diffuse"][:3])).tolist()}
    else:
        modes = {"wrap": "repeat", "mirror": "mirror"}
        color = {
            "type": "bitmap",
            "bitmap": mi.Bitmap(np.ascontiguousarray(image)),
            "filter_type": "bilinear",
            "wrap_mode": modes.get(material["wrap"], "clamp"),
        }
    return mi.load_dict({"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": color}})


def _linear(srgb: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _mesh(corners: NDArray[np.float32], uvs: NDArray[np.float32], bsdf: object, numbers: NDArray[np.int64]) -> object:
    """Corners are not shared, so every triangle keeps its own texture coordinates. Mitsuba's v runs down the image."""
    props = mi.Properties()
    props["mesh_bsdf"] = bsdf
    mesh = mi.Mesh("mesh", len(corners) * 3, len(corners), props=props, has_vertex_texcoords=True)
    flipped = np.stack([uvs[..., 0], 1 - uvs[..., 1]], -1)
    params = mi.traverse(mesh)
    params["vertex_positions"] = mi.Float(corners.ravel())
    params["faces"] = mi.UInt32(np.arange(len(corners) * 3, dtype=np.uint32))
    params["vertex_texcoords"] = mi.Float(flipped.astype(np.float32).ravel())
    params.update()
    mesh.add_attribute("face_triangle", 1, numbers.astype(np.float32))
    return mesh
