"""Mitsuba 3 (llvm_ad_rgb, all cores): albedo, depth, normal and triangle as output variables; one camera per size, moved from tile to tile."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from tests.oracle.asset_reader import read_asset

from . import FrameFields, PeerMissing
from .scene_parts import filled_images, srgb_bytes_from_linear

VARIABLES = "albedo:albedo,depth:depth,normal:sh_normal,triangle:prim_index"


class Mitsuba:
    def __init__(self, folder: Path, samples: int = 16, texture_level: int = 0) -> None:
        """`texture_level`: mip level of the textures."""
        try:
            import mitsuba

            from tests.oracle.mitsuba_scene import MitsubaScene
        except ImportError as error:
            raise PeerMissing(f"Mitsuba 3 ({error}); pip install -r requirements/peers.lock, apt install libllvm15") from error
        self._mitsuba = mitsuba
        images = filled_images(folder)
        assets = [read_asset(path.parent) for path in sorted(folder.glob("assets/*/mesh.m3a"))]
        origin = np.array(json.loads((folder / "scene.json").read_text())["origin"])
        self._scene = MitsubaScene(assets, origin, lambda _, material: _image(images, material, texture_level))
        self._integrator = mitsuba.load_dict({"type": "aov", "aovs": VARIABLES})
        self._samples = samples
        self._cameras: dict[int, tuple[Any, Any]] = {}

    @property
    def mitsuba_scene(self) -> Any:
        """The scene, for other cameras."""
        return self._scene

    def draw(self, frame: FrameFields, x: int, y: int) -> NDArray[np.float32]:
        """Returns (H, W, channels)."""
        sensor = self._camera(frame, x, y)
        return np.array(self._mitsuba.render(self._scene.scene, sensor=sensor, integrator=self._integrator, seed=0, spp=self._samples))

    def _camera(self, frame: FrameFields, x: int, y: int) -> Any:
        fresh = self._scene._sensor(frame, x, y, self._samples)
        if frame["tile_px"] not in self._cameras:
            self._cameras[frame["tile_px"]] = fresh, self._mitsuba.traverse(fresh)
        sensor, values = self._cameras[frame["tile_px"]]
        values["to_world"] = self._mitsuba.traverse(fresh)["to_world"]
        values.update()
        return sensor

    def centres(self, frame: FrameFields, x: int, y: int) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
        hits = self._scene.hits(frame, x, y)
        return hits.id, hits.depth

    def picture(self, frame: FrameFields, x: int, y: int) -> NDArray[np.uint8]:
        return srgb_bytes_from_linear(self._scene.albedo(frame, x, y, self._samples))


def _image(images: dict[str, Path], material: dict[str, Any], level: int) -> NDArray[np.uint8] | None:
    if material["texture"] is None:
        return None
    return np.ascontiguousarray(_core.texture_level(str(images[material["texture"]]), level)[..., :3])
