"""`python -m bench stages`: CPU time of base tiles by stage: first use of textures, warm caches, and whole renders with start and commit."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from rich.console import Console
from rich.table import Table

from map3d import _core
from map3d.geometry.core_frame import core_frame
from map3d.tiles.occupancy import xy_from_morton

from .benchmark_scene import Block, fullest_blocks
from .render_pairs import HERE, RenderBenchmark, RenderOptions

RES_M: Final = 0.2
TOWNS: Final = {"town": (300, False), "town with trees": (300, True), "large town": (3400, False)}
"""Number of buildings, and whether there are trees: about 0.9, 0.9 and 10 million triangles."""
PITCHES: Final = (10.0, 45.0, 90.0)
COLORS: Final = ("webp", "jpeg")
STAGES: Final = ("visibility", "shade", "reduce", "encode")
TILES: Final = 400
"""Least number of tiles of a round, as far as there are."""
ROUNDS: Final = 3
SAMPLES: Final = 16
"""Tiles whose empty pixels are counted."""


@dataclass(frozen=True)
class StageRow:
    """CPU ms per base tile. `cold`: stages of a first round, by name; `warm`: of the quickest later one; `render`: of a whole `map3d render`, all
    processes. `empty`: share of pixels without content. `decoded`: source images that the render decoded."""

    town: str
    triangles: int
    pitch_deg: float
    color: str
    tiles: int
    empty: float
    cold: dict[str, float]
    warm: dict[str, float]
    render: float
    render_tiles: int
    decoded: int


def measure(towns: dict[str, tuple[int, bool]] = TOWNS) -> list[dict[str, Any]]:
    """Measures all towns, pitches and colours and prints the table."""
    rows = []
    for town, (buildings, trees) in towns.items():
        for pitch_deg in PITCHES:
            for color in COLORS:
                options = RenderOptions(buildings=buildings, res_m=RES_M, color=color, trees=trees, pitch_deg=pitch_deg)
                rows.append(_measure(town, RenderBenchmark(HERE, options), options))
    print_table(rows)
    return [asdict(row) for row in rows]


def _measure(town: str, bench: RenderBenchmark, options: RenderOptions) -> StageRow:
    bench.render("first")
    whole, _ = bench.render("stages")
    with bench.rendering("frame"):
        folder, fields = bench.frame("frame")
    scene, frame = _core.Scene(str(folder), 1 << 30), core_frame(fields)
    blocks = list(_blocks(scene, frame))
    cold, *warm = [_round(scene, frame, blocks) for _ in range(ROUNDS)]
    quickest = min((stages for stages, _ in warm), key=lambda stages: sum(stages.values()))
    return StageRow(
        town=town,
        triangles=scene.triangle_count,
        pitch_deg=options.pitch_deg,
        color=options.color,
        tiles=cold[1],
        empty=_empty_share(scene, frame),
        cold=cold[0],
        warm=quickest,
        render=whole.cpu_ms,
        render_tiles=whole.base_tiles,
        decoded=whole.decoded,
    )


def _blocks(scene: _core.Scene, frame: _core.Frame) -> Iterator[Block]:
    """Yields the blocks with the most tiles, until they have enough."""
    tiles = 0
    for block, count in fullest_blocks(scene, frame):
        if tiles < TILES:
            yield block
        tiles += count


def _round(scene: _core.Scene, frame: _core.Frame, blocks: list[Block]) -> tuple[dict[str, float], int]:
    """Renders the blocks; returns the CPU ms per base tile by stage, and the number of base tiles with content."""
    found = [scene.render_block(frame, *block).stats for block in blocks]
    tiles = sum(one["traced_tiles"] for one in found)
    return {stage: 1000 * sum(one[f"{stage}_s"] for one in found) / tiles for stage in STAGES}, int(tiles)


def _empty_share(scene: _core.Scene, frame: _core.Frame) -> float:
    """Returns the share of pixels without content in tiles with content, of evenly spaced ones."""
    columns, rows = xy_from_morton(scene.occupied(frame, frame.zmax))
    step = max(1, len(columns) // SAMPLES)
    shares = [float((scene.gbuffer(frame, int(x), int(y))["id"] == 0).mean()) for x, y in zip(columns[::step], rows[::step], strict=True)]
    return float(np.mean([share for share in shares if share < 1]))


def print_table(rows: list[StageRow]) -> None:
    heads = [f"{kind}, {stage}" for kind in ("first", "warm") for stage in ("all", *STAGES)]
    table = Table(
        title=f"CPU ms per base tile, colour and data tiles, {RES_M} m per pixel; render: all processes of map3d render", title_justify="left"
    )
    for column in ("town", "triangles", "pitch", "colour", "tiles", "empty", *heads, "render", "of tiles", "decoded"):
        table.add_column(column, justify="left" if column == "town" else "right")
    for row in rows:
        cells = [f"{value:.1f}" for stages in (row.cold, row.warm) for value in (sum(stages.values()), *stages.values())]
        table.add_row(
            row.town,
            f"{row.triangles:,}",
            f"{row.pitch_deg:g}",
            row.color,
            str(row.tiles),
            f"{100 * row.empty:.0f} %",
            *cells,
            f"{row.render:.1f}",
            str(row.render_tiles),
            str(row.decoded),
        )
    Console(width=240).print(table)
