"""The subprocess that computes views: traces scenes, merges them by depth, and encodes image layers. Keeps scenes open between requests."""

import math
import os
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.portrayal.encodings import Background, CannotEncode, encode_layer
from map3d.portrayal.image_formats import IMAGE_LAYERS, parse_format
from map3d.portrayal.nearby import find_nearby
from map3d.portrayal.selection import Selection, select_objects
from map3d.portrayal.service_state import to_service_ids
from map3d.portrayal.styles import DEFAULT_STYLE, STYLE_KINDS, styled_color
from map3d.portrayal.view_keys import AO_RADIUS_M
from map3d.subprocess import Handler, ReportProgress

NICENESS: Final = 10
"""Below the web server, whose tiles and pages do not wait for views."""
OPEN_SCENES: Final = 2
SELECTIONS: Final = 16
Arrays = dict[str, NDArray[Any]]


def open_tracer(setup: Mapping[str, Any]) -> Handler:
    """`setup`: {"cache_bytes": of each open scene, "samples"}. A request has "kind": view, ray or position."""
    os.nice(NICENESS)
    tracer = ViewTracer(setup["cache_bytes"], setup["samples"])
    kinds = {"view": tracer.view, "ray": tracer.ray, "position": tracer.position}

    def handle(request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], Sequence[bytes]]:
        return kinds[request["kind"]](request)

    return handle


class ViewTracer:
    def __init__(self, cache_bytes: int, samples: int) -> None:
        self._cache_bytes, self._samples = cache_bytes, samples
        self._scenes: OrderedDict[tuple[str, str], _core.Scene] = OrderedDict()
        self._selections: OrderedDict[tuple[str, str, str], NDArray[np.uint32]] = OrderedDict()

    def view(self, request: dict[str, Any]) -> tuple[dict[str, Any], Sequence[bytes]]:
        """Returns the images of a view as byte strings, or {"refused": text} where a format cannot hold the values."""
        kinds = list(dict.fromkeys(kind for image in request["images"] for kind in IMAGE_LAYERS[image["layer"]].kinds))
        arrays = merge_views([self._trace(view, kinds, request["deadline_s"]) for view in request["views"]])
        background = Background(tuple(request["background"]["color"]), request["background"]["transparent"])
        try:
            return {}, [encode(image, background, arrays) for image in request["images"]]
        except CannotEncode as error:
            return {"refused": str(error)}, []

    def ray(self, request: dict[str, Any]) -> tuple[dict[str, Any], Sequence[bytes]]:
        """Returns the objects along the line of sight through the centre of a pixel, nearest first."""
        view = request["view"]
        camera = open_camera(view["camera"])
        x_px, y_px = request["x_px"] + 0.5, request["y_px"] + 0.5
        hits = self._scene(view).pick_ray(camera, x_px, y_px, request["count"], objects=self._objects(view))
        return {"objects": [[number, distance_m] for number, distance_m, _, _ in hits]}, []

    def position(self, request: dict[str, Any]) -> tuple[dict[str, Any], Sequence[bytes]]:
        """Returns the objects whose surfaces are within a distance of a local position, nearest first."""
        view = request["view"]
        return {"objects": find_nearby(self._scene(view), tuple(request["position"]), request["tolerance_m"], self._objects(view))}, []

    def _trace(self, view: dict[str, Any], kinds: Sequence[str], deadline_s: float) -> Arrays:
        camera = open_camera(view["camera"])
        wanted = list(dict.fromkeys([*kinds, "id", "depth"]))
        styled = "color" in kinds and view["style"] != DEFAULT_STYLE
        specs = [_layer_spec(kind, view["sun"]) for kind in dict.fromkeys([*wanted, *(STYLE_KINDS if styled else ())])]
        selection = Selection.load(view["selection"])
        cut = selection.cut
        arrays = self._scene(view).render_view(
            camera, specs, samples=self._samples, threads=1, deadline_s=deadline_s, box=cut, objects=self._objects(view)
        )
        arrays = dict(arrays)
        if styled:
            arrays["color"] = styled_color(view["style"], arrays)
            arrays = {kind: arrays[kind] for kind in wanted}
        arrays["id"] = to_service_ids(arrays["id"], view["pages"])
        if view["depth_zero_m"] != 0:
            arrays["depth"] = (arrays["depth"].astype(np.float64) - view["depth_zero_m"]).astype(np.float32)
        return arrays

    def _scene(self, view: dict[str, Any]) -> _core.Scene:
        key = (view["folder"], view["version"])
        scene = self._scenes.get(key)
        if scene is None:
            for other in [one for one in self._scenes if one[0] == key[0]]:
                del self._scenes[other]
            while len(self._scenes) >= OPEN_SCENES:
                self._scenes.popitem(last=False)
            scene = self._scenes[key] = _core.Scene(view["folder"], cache_bytes=self._cache_bytes)
        self._scenes.move_to_end(key)
        return scene

    def _objects(self, view: dict[str, Any]) -> NDArray[np.uint32] | None:
        """Returns the ids of the visible objects, None for all."""
        selection = Selection.load(view["selection"])
        if not selection.needs_objects:
            return None
        key = (view["folder"], view["version"], repr(selection))
        if key not in self._selections:
            if len(self._selections) >= SELECTIONS:
                self._selections.popitem(last=False)
            self._selections[key] = select_objects(Path(view["registry"]), selection)
        return self._selections[key]


def open_camera(fields: Mapping[str, Any]) -> _core.Camera:
    """Returns the core's camera of the fields that `ViewCamera.to_json` returned."""
    arguments: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()}
    return _core.Camera(**arguments)


def encode(image: Mapping[str, Any], background: Background, arrays: Arrays) -> bytes:
    """Encodes one image of a request: {"layer", "format", "quality"}."""
    layer = IMAGE_LAYERS[image["layer"]]
    return encode_layer(layer.name, parse_format(image["format"], layer), image["quality"], background, arrays)


def merge_views(views: Sequence[Arrays]) -> Arrays:
    """Returns the view that shows the nearest surface of all scenes in each pixel; colours of nearer scenes lie over those of farther ones."""
    merged = views[0]
    for other in views[1:]:
        nearer = np.nan_to_num(other["depth"], nan=math.inf) < np.nan_to_num(merged["depth"], nan=math.inf)
        combined = {name: np.where(nearer[..., None] if array.ndim == 3 else nearer, other[name], array) for name, array in merged.items()}
        if "color" in merged:
            front, back = np.where(nearer[..., None], other["color"], merged["color"]), np.where(nearer[..., None], merged["color"], other["color"])
            combined["color"] = _over(front, back)
        merged = combined
    return merged


def _over(front: NDArray[np.uint8], back: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Returns front over back, both with straight alpha."""
    a, b = front[..., 3:].astype(np.float64) / 255, back[..., 3:].astype(np.float64) / 255
    alpha = a + b * (1 - a)
    color = (front[..., :3] * a + back[..., :3] * b * (1 - a)) / np.maximum(alpha, 1e-9)
    merged: NDArray[np.uint8] = np.rint(np.concatenate([color, alpha * 255], axis=-1)).astype(np.uint8)
    return merged


def _layer_spec(kind: Any, sun: Sequence[float]) -> _core.LayerSpec:
    match kind:
        case "sun":
            return _core.LayerSpec(kind, "png", suns=[list(sun)])
        case "ao":
            return _core.LayerSpec(kind, "png", radius_m=AO_RADIUS_M)
        case _:
            return _core.LayerSpec(kind, "png")
