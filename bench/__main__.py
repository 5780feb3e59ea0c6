"""`python -m bench [--buildings N] [--res M] [--tiles N] [--json]`."""

import argparse
import json

from rich.console import Console
from rich.table import Table

from .tiles import measure


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="bench", description="Non-empty base tiles a second, 256 px, 16 samples, four layers; peers in the same run."
    )
    parser.add_argument("--buildings", type=int, default=300)
    parser.add_argument("--res", type=float, default=0.2, help="metres a pixel")
    parser.add_argument("--tiles", type=int, default=48)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = [measure(options.buildings, options.res, options.tiles, color) for color in ("webp", "jpeg")]
    if options.json:
        print(json.dumps(rows, indent=1))
        return
    table = Table(title=f"base tiles a second, {options.buildings} buildings at {options.res} m a pixel")
    for column in ("triangles", "tiles", "colour", "one core", "one core, encoded", "all cores, encoded", "Mitsuba 3, all cores", "ratio"):
        table.add_column(column, justify="right")
    for row in rows:
        peer = row["mitsuba_all_cores"]
        rates = [f"{row[key]:.1f}" for key in ("one_core", "one_core_encoded", "all_cores_encoded")]
        beside = ["not installed", ""] if peer is None else [f"{peer:.1f}", f"{row['all_cores_encoded'] / peer:.1f} ×"]
        table.add_row(f"{row['triangles']:,}", str(row["tiles"]), row["color"], *rates, *beside)
    Console().print(table)


if __name__ == "__main__":
    main()
