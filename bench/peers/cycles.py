"""Blender's Cycles on the processor (all cores), with persistent data; a program of its own under a Python of its own, see cycles_program.py.

Layers leave Blender as an uncompressed EXR in memory (/dev/shm): its Python has no other way to several layers of a render.
"""

import json
import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import Frame, Missing
from .parts import depths, linear, parts, square, srgb_bytes

PYTHON = Path(".cache/cycles/bin/python")
PROGRAM = Path(__file__).with_name("cycles_program.py")
MAX_NAMES = 32_767
"""Blender's object numbers."""


class Cycles:
    def __init__(self, folder: Path, samples: int = 16) -> None:
        if not PYTHON.exists():
            raise Missing(f"Blender Cycles ({PYTHON} is not there); make bench-cycles")
        self._samples = samples
        self._room = tempfile.TemporaryDirectory(prefix="bench-", dir="/dev/shm")
        self._file = Path(self._room.name, "layers.exr")
        self._program = subprocess.Popen([PYTHON, "-P", PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._names, self._lo, self._hi = _hand_over(folder, Path(self._room.name, "parts.npz"))
        self.device = self._tell(json.loads(Path(self._room.name, "setup.json").read_text()))["device"]

    def _tell(self, order: dict[str, Any]) -> dict[str, Any]:
        assert self._program.stdin is not None
        assert self._program.stdout is not None
        print(json.dumps(order), file=self._program.stdin, flush=True)
        answer = self._program.stdout.readline()
        if not answer:
            raise SystemExit(f"bench: Cycles ended with status {self._program.wait()}")
        told: dict[str, Any] = json.loads(answer)
        return told

    def draw(self, frame: Frame, x: int, y: int) -> Path:
        """The file has colour, depth, normal and object number."""
        return self._render(frame, x, y, self._samples, centres=False)

    def _render(self, frame: Frame, x: int, y: int, samples: int, centres: bool) -> Path:
        at = square(frame, x, y)
        near, _ = depths(self._lo, self._hi, at.axes)
        right, up, forward = (np.array(axis) for axis in at.axes)
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = right, up, -forward
        matrix[:3, 3] = right * at.u_m + up * at.v_m + forward * near
        order = {"matrix": matrix.ravel().tolist(), "side_m": at.side_m, "px": at.px, "samples": samples, "centres": centres, "file": str(self._file)}
        self._tell(order)
        return self._file

    def centres(self, frame: Frame, x: int, y: int) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
        layers = self._layers(frame, x, y, 1, centres=True)
        near, far = depths(self._lo, self._hi, square(frame, x, y).axes)
        depth = layers["depth"].astype(float)
        names = layers["name"].round().astype(int)
        hit = depth < far - near + 1
        return np.where(hit, self._names[names], 0).astype(np.uint32), np.where(hit, depth + near - frame["d0_m"], np.inf)

    def picture(self, frame: Frame, x: int, y: int) -> NDArray[np.uint8]:
        return srgb_bytes(self._layers(frame, x, y, self._samples, centres=False)["color"])

    def _layers(self, frame: Frame, x: int, y: int, samples: int, centres: bool) -> dict[str, NDArray[np.float32]]:
        """color (H, W, 3) linear, depth from the camera and number of the object (H, W)."""
        file = self._render(frame, x, y, samples, centres)
        self._tell({"read": str(file), "into": str(file.with_suffix(".npz"))})
        with np.load(file.with_suffix(".npz")) as layers:
            return dict(layers)


def _hand_over(folder: Path, file: Path) -> tuple[NDArray[np.uint32], NDArray[np.float64], NDArray[np.float64]]:
    """Writes the triangles and images where the program finds them; returns the ids by Blender's numbers, and the box."""
    from PIL import Image

    arrays: dict[str, NDArray[Any]] = {}
    looks: list[dict[str, Any]] = []
    lo, hi, ids = np.full(3, np.inf), np.full(3, -np.inf), [np.zeros(1, np.uint32)]
    held = list(parts(folder))
    ids = np.unique(np.concatenate([*ids, *(part.ids for part in held)]))
    if len(ids) > MAX_NAMES:
        raise Missing(f"Blender Cycles (numbers {MAX_NAMES:,} objects at most, there are {len(ids):,})")
    for number, part in enumerate(held):
        lo, hi = np.minimum(lo, part.corners.min((0, 1))), np.maximum(hi, part.corners.max((0, 1)))
        arrays[f"corners{number}"], arrays[f"uvs{number}"] = part.corners.astype("f4"), part.uvs
        arrays[f"names{number}"] = np.searchsorted(ids, part.ids)
        path = None
        if part.image is not None:
            path = str(file.with_name(f"image{number}.bmp"))
            Image.fromarray(part.image).save(path)
        looks.append({"image": path, "diffuse": linear(np.array(part.diffuse)).tolist(), "repeats": part.repeats})
    np.savez(file, **arrays)
    setup = {"parts": str(file), "looks": looks, "cores": len(os.sched_getaffinity(0))}
    file.with_name("setup.json").write_text(json.dumps(setup))
    return ids, lo, hi
