"""`python -m bench [PART …] [--json]` prints the tables of docs/benchmarks.md for the current machine."""

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from . import catalogue, extent, incremental, ingest, large_citygml, planning, render_pairs, stages, tiles, viewer
from .benchmark_scene import CACHE

Rows = list[dict[str, Any]]
PARTS: Final[dict[str, Callable[[argparse.Namespace], Rows]]] = {
    "tiles": lambda options: tiles.measure_all(options.buildings, options.res, options.tiles),
    "ingest": lambda options: ingest.measure(),
    "incremental": lambda options: incremental.measure(),
    "stages": lambda options: stages.measure(),
    "render": lambda options: render_pairs.measure(
        options.against,
        options.pairs,
        render_pairs.RenderOptions(options.buildings, options.render_res, options.directions, options.color, options.workers),
    ),
    "extent": lambda options: extent.measure(tuple(options.millions), plots=Path("docs/plots")),
    "large": lambda options: large_citygml.measure(options.megabytes),
    "planning": lambda options: planning.measure(),
    "catalogue": lambda options: catalogue.measure(options.catalogues, options.jobs),
    "viewer": lambda options: viewer.measure(options.quick, options.reps, options.work, tuple(options.only) if options.only else None, options.free),
}
DEFAULT: Final = ("tiles", "ingest", "incremental")


def main() -> None:
    parser = argparse.ArgumentParser(prog="bench", description="Measures speed and memory, with peers in the same run.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)} (default: {', '.join(DEFAULT)})")
    parser.add_argument("--buildings", type=int, default=300, help="tiles, render: number of buildings of the town")
    parser.add_argument("--res", type=float, default=0.2, help="tiles: metres per pixel")
    parser.add_argument("--tiles", type=int, default=48, help="tiles: number of tiles")
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="render: another checkout with a compiled core, to compare with")
    parser.add_argument("--render-res", type=float, default=0.1, help="render: metres per pixel")
    parser.add_argument("--pairs", type=int, default=5, help="render: number of renders of each version")
    parser.add_argument("--directions", type=int, default=1, help="render: number of views")
    parser.add_argument("--color", choices=("webp", "png", "jpeg"), default="webp", help="render: format of the colour layer")
    parser.add_argument("--workers", type=int, default=2, help="render: number of worker processes")
    parser.add_argument("--millions", type=float, nargs="+", default=extent.MILLIONS, help="extent: sizes in million triangles")
    parser.add_argument("--megabytes", type=float, nargs="+", default=large_citygml.MEGABYTES, help="large: sizes of the CityGML files")
    parser.add_argument("--catalogues", nargs="+", default=[], metavar="URL", help="catalogue: MongoDB servers, without a database")
    parser.add_argument("--jobs", type=int, nargs="+", default=catalogue.PLANNED_JOBS, help="catalogue: numbers of base blocks to plan")
    parser.add_argument("--quick", action="store_true", help="viewer: a small town without peers, as a smoke test")
    parser.add_argument("--reps", type=int, default=5, help="viewer: number of rounds")
    parser.add_argument("--only", nargs="+", help="viewer: measures, e.g. first frames")
    parser.add_argument("--free", action="store_true", help="viewer: disable vsync, for browsers with a GPU")
    parser.add_argument("--work", type=Path, default=CACHE / "viewer", help="viewer: folder for cities and samples, needs 9 GB")
    parser.add_argument("--json", action="store_true", help="print one JSON document after the tables")
    options = parser.parse_args()
    if unknown := [part for part in options.parts if part not in PARTS]:
        parser.error(f"unknown part {unknown[0]!r}; choose from {', '.join(PARTS)}")
    rows = {part: PARTS[part](options) for part in options.parts or DEFAULT}
    if options.json:
        print(json.dumps(rows, indent=1, default=str))


if __name__ == "__main__":
    main()
