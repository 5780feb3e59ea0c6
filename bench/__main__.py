"""`python -m bench [PART …] [--json]`. Parts: tiles, light, encoding, ingest, incremental (the default); extent, planning, stored, viewer,
catalogue, overhead, saturation, view, large, render, formats, stages."""

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from . import (
    catalogue,
    catalogue_overhead,
    color_formats,
    encoding,
    extent,
    incremental,
    ingest,
    large_citygml,
    light_layers,
    planning,
    render_pairs,
    saturation,
    stages,
    stored,
    tiles,
    view,
    viewer,
)
from .benchmark_scene import CACHE

PARTS = ("tiles", "light", "encoding", "ingest", "incremental")
ON_REQUEST = ("extent", "planning", "stored", "viewer", "catalogue", "overhead", "saturation", "view", "large", "render", "formats", "stages")
Rows = list[dict[str, Any]]


def main() -> None:
    parser = argparse.ArgumentParser(prog="bench", description="Measures speed, with peers in the same run.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)} (default: these), {', '.join(ON_REQUEST)}")
    parser.add_argument("--millions", type=float, nargs="+", help="extent, view: sizes in million triangles (1 3 10, 1 10)")
    parser.add_argument("--megabytes", type=float, nargs="+", help="large: sizes of the CityGML files (50 200 1000)")
    parser.add_argument("--buildings", type=int, default=300, help="tiles, render, formats: number of buildings of the town")
    parser.add_argument("--res", type=float, default=0.2, help="tiles, formats: metres per pixel")
    parser.add_argument("--render-res", type=float, default=0.1, help="render: metres per pixel")
    parser.add_argument("--tiles", type=int, default=48, help="tiles, formats: number of tiles")
    parser.add_argument("--folders", type=Path, nargs="+", default=[CACHE], help="stored: folders with renderings or published folders")
    parser.add_argument(
        "--catalogues", nargs="+", default=[], metavar="URL", help="catalogue, overhead, saturation: MongoDB servers, without a database"
    )
    parser.add_argument(
        "--jobs", type=int, nargs="+", default=catalogue.PLANNED_JOBS, help="catalogue: numbers of base blocks to plan; saturation: the least of them"
    )
    parser.add_argument("--quick", action="store_true", help="viewer: a small town without peers, as a smoke test; view: without Mitsuba")
    parser.add_argument("--reps", type=int, default=5, help="viewer, view: number of rounds")
    parser.add_argument("--only", nargs="+", help="viewer: measures, e.g. first frames")
    parser.add_argument("--free", action="store_true", help="viewer: disable vsync, for browsers with a GPU")
    parser.add_argument("--work", type=Path, help="viewer: folder for cities and samples, needs 9 GB; view: folder for towns, needs 5 GB")
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="render: another checkout with a compiled core, to compare with")
    parser.add_argument("--pairs", type=int, default=5, help="render: number of renders of each version")
    parser.add_argument("--directions", type=int, default=1, help="render: number of views")
    parser.add_argument("--color", choices=("webp", "png", "jpeg"), default="webp", help="render: format of the colour layer")
    parser.add_argument("--workers", type=int, default=2, help="render: number of worker processes")
    parser.add_argument("--json", action="store_true", help="print one JSON document after the tables")
    options = parser.parse_args()
    unknown = [part for part in options.parts if part not in PARTS + ON_REQUEST]
    if unknown:
        parser.error(f"unknown part {unknown[0]!r}; choose from {', '.join(PARTS + ON_REQUEST)}")
    measures: dict[str, Callable[[], Rows]] = {
        "tiles": lambda: measure_tiles(options.buildings, options.res, options.tiles),
        "light": light_layers.measure,
        "encoding": encoding.measure,
        "ingest": ingest.measure,
        "incremental": incremental.measure,
        "extent": lambda: extent.measure(tuple(options.millions or extent.MILLIONS), plots=Path("docs/plots")),
        "large": lambda: large_citygml.measure(options.megabytes or large_citygml.MEGABYTES),
        "planning": planning.measure,
        "catalogue": lambda: catalogue.measure(options.catalogues, options.jobs),
        "overhead": lambda: catalogue_overhead.measure(options.catalogues),
        "saturation": lambda: saturation.measure(options.catalogues, min(options.jobs)),
        "view": lambda: view.measure(tuple(options.millions or (1, 10)), options.work or CACHE / "view", options.reps, not options.quick),
        "render": lambda: render_pairs.measure(
            options.against,
            options.pairs,
            render_pairs.RenderOptions(options.buildings, options.render_res, options.directions, options.color, options.workers),
        ),
        "stages": stages.measure,
        "formats": lambda: color_formats.measure(options.buildings, options.res, options.tiles),
        "stored": lambda: stored.measure(options.folders),
        "viewer": lambda: viewer.measure(
            options.quick, options.reps, options.work or CACHE / "viewer", tuple(options.only) if options.only else None, options.free
        ),
    }
    rows = {part: measures[part]() for part in options.parts or PARTS}
    if options.json:
        print(json.dumps(rows, indent=1, default=str))


def measure_tiles(buildings: int, res_m: float, count: int) -> Rows:
    """Measures both colour formats and prints the table; returns its rows and those of the peers."""
    rows = [tiles.measure(buildings, res_m, count, color) for color in ("webp", "jpeg")]
    table = Table(title=f"base tiles per second, 256 px, 16 samples, colour and data tiles, {buildings} buildings at {res_m} m per pixel")
    for column in ("triangles", "tiles", "colour", "one core", "one core, encoded", "all cores, encoded"):
        table.add_column(column, justify="right")
    for row in rows:
        rates = [f"{row[key]:.1f}" for key in ("one_core", "one_core_encoded", "all_cores_encoded")]
        table.add_row(f"{row['triangles']:,}", str(row["tiles"]), row["color"], *rates)
    Console().print(table)
    return [*rows, tiles.measure_peers(buildings, res_m)]


if __name__ == "__main__":
    main()
