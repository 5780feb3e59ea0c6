"""`python -m bench.rotterdam [--scale N]`: a city of the Rotterdam class, from generation to a published folder, with the time of each stage.

At scale 1: 62,000 buildings in 90 CityGML files, 26,474 textures of 1024², an orthophoto of 65,536², one view at 45 degrees with nine levels
(87,381 tiles of colour and of data). Scale N divides buildings, files, textures and orthophoto pixels by N, and base tiles by the nearest power of
four.
Imported files of the town are deleted. Re-run it to resume an interrupted run.
"""

import argparse
import json
import math
import shutil
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from map3d_town import TownSpec, estimate_town

from .resource_monitor import ResourceUsage, disk_bytes_of, run_monitored

CACHE = Path(".cache/bench")
BUILDINGS, FILES, TEXTURES, ORTHO_PX, ZMAX = 62_000, 90, 26_474, 65_536, 8
PITCH = 45
FILLED = 0.68
"""Side of the window over that of the town: slightly less than sin 45°, the height of a square at 45 degrees."""
BYTES_PER_TOWN_BYTE, BYTES_PER_DEM_PX, BYTES_PER_BASE_TILE, SPARE_BYTES = 2.5, 330, 160_000, 1 << 28
"""Measured peak disk usage of buildings and textures, terrain (two triangles per pixel), stored and published tiles."""
MIB = 1 << 20


@dataclass(frozen=True)
class CityScale:
    """A scale of the benchmark and its folder."""

    scale: int
    folder: Path

    @property
    def spec(self) -> TownSpec:
        return TownSpec(
            buildings=BUILDINGS // self.scale,
            files=max(1, FILES // self.scale),
            textures=TEXTURES // self.scale,
            texture_px=1024,
            ortho_px=math.ceil(ORTHO_PX / math.sqrt(self.scale)),
        )

    @property
    def town(self) -> Path:
        """A copy of town.json, kept when the town's files are deleted."""
        return self.folder / "town.json"

    @property
    def zmax(self) -> int:
        return max(0, round(ZMAX - math.log2(self.scale) / 2))


def stages(size: CityScale) -> dict[str, Callable[[], list[str]]]:
    """Returns functions that give the arguments of each command; that of create-rendering needs the town."""
    spec, folder = size.spec, size.folder
    where = ["-w", str(folder / "workspace")]
    town = ["--buildings", spec.buildings, "--files", spec.files, "--textures", spec.textures, "--texture-px", spec.texture_px]
    return {
        "make-town": lambda: ["make-town", "-o", str(folder / "town"), *map(str, town), "--ortho-px", str(spec.ortho_px)],
        "create-scene": lambda: ["create-scene", "city", *where],
        "add-files": lambda: ["add-files", "city", str(folder / "town"), *where],
        "create-rendering": lambda: ["create-rendering", "city", "view", *view_options(size), *where],
        "render": lambda: ["render", "view", *where],
        "publish": lambda: ["publish", "view", "-o", str(folder / "published"), *where],
    }


def view_options(size: CityScale) -> list[str]:
    side_m = json.loads(size.town.read_text())["extent_m"] * FILLED
    return ["--view", f"0/{PITCH}", "--levels", str(size.zmax + 1), "--window", f"{size.spec.east_m},{size.spec.north_m},{side_m:.2f}"]


def check_disk(size: CityScale) -> int:
    """Returns the maximum disk usage in bytes; exits if it exceeds the free space."""
    town = estimate_town(size.spec)
    dem_px = (town.extent_m / size.spec.dem_pixel_m(town.extent_m)) ** 2
    needed = int(town.disk_bytes * BYTES_PER_TOWN_BYTE + dem_px * BYTES_PER_DEM_PX + 4**size.zmax * BYTES_PER_BASE_TILE + SPARE_BYTES)
    size.folder.mkdir(parents=True, exist_ok=True)
    free = shutil.disk_usage(size.folder).free + disk_bytes_of(size.folder)
    if needed > free:
        raise SystemExit(f"bench: {size.folder} needs about {needed / 1e9:.1f} GB, but only {free / 1e9:.1f} GB are free; use a larger --scale")
    return needed


def measure(size: CityScale) -> dict[str, Any]:
    """Runs the stages that are not done yet; returns all figures, those of earlier runs included."""
    path = size.folder / "figures.json"
    record: dict[str, Any] = json.loads(path.read_text()) if path.is_file() else {"scale": size.scale, "stages": {}, "done": []}
    record.setdefault("disk_needed_bytes", check_disk(size) if not record["done"] else 0)
    for name, words in stages(size).items():
        if name in record["done"]:
            continue
        figures = ResourceUsage(**record["stages"].get(name, {}))
        print(f"bench: {name}", file=sys.stderr, flush=True)
        try:
            status = run_monitored([sys.executable, "-m", "map3d", *words()], size.folder, figures)
        finally:
            record["stages"][name] = asdict(figures)
            path.write_text(json.dumps(record, indent=1))
        if status != 0:
            raise SystemExit(f"bench: map3d {name} failed with status {status}; re-run to resume")
        if name == "make-town":
            shutil.copy(size.folder / "town" / "town.json", size.town)
        record["done"].append(name)
        path.write_text(json.dumps(record, indent=1))
        if name == "add-files":
            shutil.rmtree(size.folder / "town")
    record["facts"] = collect_facts(size)
    path.write_text(json.dumps(record, indent=1))
    return record


def collect_facts(size: CityScale) -> dict[str, Any]:
    """Returns counts and sizes of the results."""
    town = json.loads(size.town.read_text())
    manifest = json.loads((size.folder / "published" / "rendering.json").read_text())
    from map3d.tiles.occupancy import Occupancy

    occupancy = Occupancy.decode(manifest["zmax"], manifest["views"][0]["occupancy"])
    gml = [bytes_ for name, bytes_ in town["files"].items() if name.startswith("citygml/buildings_")]
    return {
        "buildings": town["buildings"],
        "citygml_files": len(gml),
        "citygml_bytes": sum(gml),
        "textures": sum("/textures/a" in name for name in town["files"]),
        "town_bytes": sum(town["files"].values()),
        "ortho_bytes": town["files"]["terrain/ortho.tif"],
        "extent_m": town["extent_m"],
        "pixel_m": manifest["size_m"] / (manifest["tile_px"] << manifest["zmax"]),
        "tiles": occupancy.count(),
        "layers": len(manifest["layers"]),
        "base_tiles": occupancy.count(manifest["zmax"]),
        "base_filled": occupancy.count(manifest["zmax"]) / 4 ** manifest["zmax"],
        "published_bytes": disk_bytes_of(size.folder / "published"),
    }


def format_table(record: dict[str, Any]) -> str:
    """Formats the Markdown table of docs/benchmarks.md."""
    facts, rows = record["facts"], record["stages"]
    lines = [
        f"{facts['buildings']:,} buildings in {facts['citygml_files']} CityGML files ({facts['citygml_bytes'] / 1e9:.2f} GB), "
        f"{facts['textures']:,} textures of 1024², orthophoto {facts['ortho_bytes'] / 1e9:.2f} GB, in all {facts['town_bytes'] / 1e9:.1f} GB; "
        f"{facts['tiles']:,} tiles × {facts['layers']} layers at {facts['pixel_m']:.3f} m per pixel, "
        f"{100 * facts['base_filled']:.0f} % of the base tiles filled; {facts['published_bytes'] / 1e9:.2f} GB published.",
        "",
        "| stage | minutes | CPU minutes | memory, MiB | disk after, GB |",
        "|---|---|---|---|---|",
    ]
    for name, row in rows.items():
        lines.append(
            f"| {name} | {row['wall_s'] / 60:.1f} | {row['cpu_s'] / 60:.1f} | {row['memory_bytes'] / MIB:,.0f} | {row['disk_bytes'] / 1e9:.1f} |"
        )
    total = [sum(row[key] for row in rows.values()) / 60 for key in ("wall_s", "cpu_s")]
    peak = [max(row[key] for row in rows.values()) for key in ("memory_bytes", "disk_peak_bytes")]
    lines.append(f"| all | {total[0]:.1f} | {total[1]:.1f} | {peak[0] / MIB:,.0f} | {peak[1] / 1e9:.1f} at the peak |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(prog="bench.rotterdam", description="Generates, renders and publishes a city of the Rotterdam class.")
    parser.add_argument("--scale", type=int, default=1, help="divides the size by N; `make bench` runs 20")
    parser.add_argument("--folder", type=Path, help="default: .cache/bench/rotterdam-SCALE")
    parser.add_argument("--keep", action="store_true", help="keep town, workspace and published folder")
    options = parser.parse_args()
    size = CityScale(options.scale, options.folder or CACHE / f"rotterdam-{options.scale}")
    record = measure(size)
    (size.folder / "table.md").write_text(format_table(record))
    print(format_table(record))
    print(f"figures: {size.folder / 'figures.json'}; table: {size.folder / 'table.md'}")
    if not options.keep:
        for name in ("town", "workspace", "published"):
            shutil.rmtree(size.folder / name, ignore_errors=True)


if __name__ == "__main__":
    main()
