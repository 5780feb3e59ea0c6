"""Blender's Cycles on the CPU (all cores), with persistent data, as a separate program with its own Python (cycles_program.py).

Blender writes the layers as an uncompressed EXR in memory (/dev/shm), because its Python gives no other access to several layers of a render.
"""

import json
import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import FrameFields, PeerMissing
from .scene_parts import depth_range, linear_from_srgb, read_parts, srgb_bytes_from_linear, tile_square

PYTHON = Path(".cache/cycles/bin/python")
PROGRAM = Path(__file__).with_name("cycles_program.py")
MAX_OBJECTS = 32_767
"""Blender's limit of object numbers."""


class Cycles:
    def __init__(self, folder: Path, samples: int = 16) -> None:
        if not PYTHON.exists():
            raise PeerMissing(f"Blender Cycles ({PYTHON} does not exist); run make bench-cycles")
        self._samples = samples
        self._folder = tempfile.TemporaryDirectory(prefix="bench-", dir="/dev/shm")
        self._file = Path(self._folder.name, "layers.exr")
        self._program = subprocess.Popen([PYTHON, "-P", PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._names, self._lo, self._hi = _write_input(folder, Path(self._folder.name, "parts.npz"))
        self.device = self._request(json.loads(Path(self._folder.name, "setup.json").read_text()))["device"]

    def _request(self, order: dict[str, Any]) -> dict[str, Any]:
        assert self._program.stdin is not None
        assert self._program.stdout is not None
        print(json.dumps(order), file=self._program.stdin, flush=True)
        line = self._program.stdout.readline()
        if not line:
            raise SystemExit(f"bench: Cycles exited with status {self._program.wait()}")
        response: dict[str, Any] = json.loads(line)
        return response

    def draw(self, frame: FrameFields, x: int, y: int) -> Path:
        """Writes a file with colour, depth, normal and object number."""
        return self._render(frame, x, y, self._samples, centres=False)

    def _render(self, frame: FrameFields, x: int, y: int, samples: int, centres: bool) -> Path:
        at = tile_square(frame, x, y)
        near, _ = depth_range(self._lo, self._hi, at.axes)
        right, up, forward = (np.array(axis) for axis in at.axes)
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = right, up, -forward
        matrix[:3, 3] = right * at.u_m + up * at.v_m + forward * near
        order = {"matrix": matrix.ravel().tolist(), "side_m": at.side_m, "px": at.px, "samples": samples, "centres": centres, "file": str(self._file)}
        self._request(order)
        return self._file

    def centres(self, frame: FrameFields, x: int, y: int) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
        layers = self._layers(frame, x, y, 1, centres=True)
        near, far = depth_range(self._lo, self._hi, tile_square(frame, x, y).axes)
        depth = layers["depth"].astype(float)
        names = layers["name"].round().astype(int)
        hit = depth < far - near + 1
        return np.where(hit, self._names[names], 0).astype(np.uint32), np.where(hit, depth + near - frame["d0_m"], np.inf)

    def picture(self, frame: FrameFields, x: int, y: int) -> NDArray[np.uint8]:
        return srgb_bytes_from_linear(self._layers(frame, x, y, self._samples, centres=False)["color"])

    def _layers(self, frame: FrameFields, x: int, y: int, samples: int, centres: bool) -> dict[str, NDArray[np.float32]]:
        """Returns color (H, W, 3) linear, depth from the camera and name, the object's number (H, W)."""
        file = self._render(frame, x, y, samples, centres)
        self._request({"read": str(file), "into": str(file.with_suffix(".npz"))})
        with np.load(file.with_suffix(".npz")) as layers:
            return dict(layers)


def _write_input(folder: Path, file: Path) -> tuple[NDArray[np.uint32], NDArray[np.float64], NDArray[np.float64]]:
    """Writes triangles and images for the program; returns the ids by Blender's number, and the bounding box."""
    from PIL import Image

    arrays: dict[str, NDArray[Any]] = {}
    materials: list[dict[str, Any]] = []
    lo, hi, ids = np.full(3, np.inf), np.full(3, -np.inf), [np.zeros(1, np.uint32)]
    parts = list(read_parts(folder))
    ids = np.unique(np.concatenate([*ids, *(part.ids for part in parts)]))
    if len(ids) > MAX_OBJECTS:
        raise PeerMissing(f"Blender Cycles (supports at most {MAX_OBJECTS:,} objects, the scene has {len(ids):,})")
    for number, part in enumerate(parts):
        lo, hi = np.minimum(lo, part.corners.min((0, 1))), np.maximum(hi, part.corners.max((0, 1)))
        arrays[f"corners{number}"], arrays[f"uvs{number}"] = part.corners.astype("f4"), part.uvs
        arrays[f"names{number}"] = np.searchsorted(ids, part.ids)
        path = None
        if part.image is not None:
            path = str(file.with_name(f"image{number}.bmp"))
            Image.fromarray(part.image).save(path)
        materials.append({"image": path, "diffuse": linear_from_srgb(np.array(part.diffuse)).tolist(), "repeats": part.repeats})
    np.savez(file, **arrays)
    setup = {"parts": str(file), "materials": materials, "cores": len(os.sched_getaffinity(0))}
    file.with_name("setup.json").write_text(json.dumps(setup))
    return ids, lo, hi
