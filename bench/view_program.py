"""The process of bench/view.py that renders one view as a server's does, first with nothing in its caches.

`python -m bench.view_program SCENE VIEW ROUNDS` prints one JSON document: {"triangles", "cold": stages, "warm": stages, "bytes": of each image,
"stats"}; stages are milliseconds of CPU time.
"""

import json
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

from map3d import _core
from map3d.portrayal.encodings import Background, encode_layer
from map3d.portrayal.image_formats import IMAGE_LAYERS

from .view_cameras import view_camera

CACHE_BYTES = 1 << 30
IMAGES = ("COLOR", "DEPTH", "OBJECTID", "NORMAL", "MASK")
Stages = dict[str, float]


def layer_specs() -> list[_core.LayerSpec]:
    return [_core.LayerSpec(kind, "png") for kind in ("color", "normal", "id", "depth")]


def cpu_ms(work: Callable[[], Any]) -> tuple[float, Any]:
    """Returns the CPU time of all threads of this process, and the result."""
    begun = time.process_time()
    result = work()
    return (time.process_time() - begun) * 1e3, result


def render(scene: _core.Scene, camera: _core.Camera) -> tuple[Stages, dict[str, int]]:
    """Renders and encodes; returns the times by stage and the bytes of the images."""
    before = scene.view_times()
    total, arrays = cpu_ms(lambda: scene.render_view(camera, layer_specs()))
    after = scene.view_times()
    stages = {name.removesuffix("_s"): (after[name] - before[name]) * 1e3 for name in after if name != "light_s"}
    stages["other"] = total - sum(stages.values())
    sizes = {}
    for name in IMAGES:
        layer = IMAGE_LAYERS[name]
        stages[name], data = cpu_ms(lambda layer=layer: encode_layer(layer.name, layer.formats[0], 80, Background(), arrays))
        sizes[name] = len(data)
    stages["total"] = total + sum(stages[name] for name in IMAGES)
    return stages, sizes


def main() -> None:
    folder, name, rounds = sys.argv[1], sys.argv[2], int(sys.argv[3])
    opened, scene = cpu_ms(lambda: _core.Scene(folder, CACHE_BYTES))
    camera = view_camera(scene, name)
    cold, sizes = render(scene, camera)
    cold = {"open": opened, **cold, "total": cold["total"] + opened}
    warm = [render(scene, camera)[0] for _ in range(rounds)]
    medians = {stage: statistics.median(times[stage] for times in warm) for stage in warm[0]}
    print(json.dumps({"triangles": scene.triangle_count, "cold": cold, "warm": medians, "bytes": sizes, "stats": scene.stats()}))


if __name__ == "__main__":
    main()
