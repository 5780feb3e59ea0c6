"""CPU time per base tile of the rays of the light layers, next to that of visibility and shading."""

import math
from typing import Any, Final

from rich.console import Console
from rich.table import Table

from map3d import _core
from map3d.geometry.core_frame import core_frame

from .benchmark_scene import fullest_blocks, prepare_scene

BUILDINGS: Final = 300
RES_M: Final = 0.2
BLOCKS: Final = 3
ROUNDS: Final = 3
RADIUS_M: Final = 20.0
SUN: Final = (0.6, -0.48, 0.64)
SUNS: Final = 16


def measure() -> list[dict[str, Any]]:
    """Measures each layer kind and prints the table."""
    folder, frames = prepare_scene(BUILDINGS, RES_M, "webp")
    fields = next(iter(frames.values()))
    scene = _core.Scene(str(folder))
    blocks = [block for block, _ in fullest_blocks(scene, core_frame(fields))[:BLOCKS]]
    rows = [_measure_layer(scene, kind, core_frame({**fields, "layers": [layer]}), blocks) for kind, layer in layers().items()]
    table = Table(title=f"layers of light, ms of CPU time per base tile, {scene.triangle_count:,} triangles at {RES_M} m per pixel")
    for column in ("layer", "tiles", "visibility and shading", "rays", "rays per sun"):
        table.add_column(column, justify="right")
    for row in rows:
        each = f"{row['light_ms'] / row['suns']:.2f}" if row["suns"] else ""
        table.add_row(row["kind"], str(row["tiles"]), f"{row['before_ms']:.2f}", f"{row['light_ms']:.2f}", each)
    Console().print(table)
    return rows


def layers() -> dict[str, dict[str, Any]]:
    """Returns the core's layers by kind."""
    day = [_sun_direction(40.0 + 280.0 * (k + 0.5) / SUNS, 60.0 * math.sin(math.pi * (k + 0.5) / SUNS)) for k in range(SUNS)]
    options: dict[str, dict[str, Any]] = {
        "sun": {"suns": [SUN]},
        "sun16": {"suns": day},
        "ao": {"radius_m": RADIUS_M},
        "depth2": {},
        "picture": {"suns": [SUN], "radius_m": RADIUS_M},
    }
    return {kind: {"kind": kind, "format": "png", **more} for kind, more in options.items()}


def _measure_layer(scene: _core.Scene, kind: str, frame: _core.Frame, blocks: list[tuple[int, int, int]]) -> dict[str, Any]:
    """Measures the fastest round after a warm-up round."""
    rounds = []
    for _ in range(ROUNDS + 1):
        stats = [scene.render_block(frame, *block).stats for block in blocks]
        tiles = sum(one["traced_tiles"] for one in stats)
        before = sum(one["visibility_s"] + one["shade_s"] for one in stats)
        rounds.append((sum(one["light_s"] for one in stats) / tiles * 1e3, before / tiles * 1e3, tiles))
    light_ms, before_ms, tiles = min(rounds[1:])
    return {"kind": kind, "tiles": int(tiles), "light_ms": light_ms, "before_ms": before_ms, "suns": len(layers()[kind].get("suns", ()))}


def _sun_direction(azimuth_deg: float, elevation_deg: float) -> tuple[float, float, float]:
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return (math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e))
