"""Out-of-core rendering of towns of growing extent and equal density within a fixed memory: `python -m bench extent`.

Each size consists of copies of one district of 300 buildings with terrain and textures, without trees (bench/district.py). For each size the
benchmark builds the scene from scratch, plans a rendering, and renders the same number of base blocks in two workers within 1 GiB
(bench/extent_programs.py).
"""

import json
import shutil
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from map3d.catalogue import Catalogue, Workspace

from .benchmark_scene import CACHE, run_verb
from .district import DistrictCopier
from .resource_monitor import ResourceUsage, run_monitored
from .svg_plot import plot

MILLIONS = (1, 3, 10)
BUILDINGS, BLOCKS, RES_M, TEXTURE_PX = 300, 40, 0.04, 512
BYTES_PER_TRIANGLE, SPARE_BYTES = 380, 1 << 30
"""Measured peak disk usage of assets, textures, chunks and temporary files of the build."""
MIB = 1 << 20
Row = dict[str, Any]


def measure(millions: tuple[float, ...] = MILLIONS, folder: Path = CACHE / "extent", plots: Path | None = None, blocks: int = BLOCKS) -> list[Row]:
    """Measures each size, prints the table and draws plots into `plots`. Returns the rows, with those of earlier runs in `folder`."""
    kept = folder / "sizes.json"
    rows: list[Row] = json.loads(kept.read_text()) if kept.is_file() else []
    _check_disk(folder, max(millions))
    workspace = Workspace(folder / "workspace").create()
    try:
        _create_district(workspace, folder)
        for size in sorted(millions):
            row = _measure_size(workspace, folder, size, blocks)
            rows = sorted([*(old for old in rows if old["millions"] != size), row], key=lambda row: row["triangles"])
            kept.write_text(json.dumps(rows, indent=1))
            Console().print(f"{row['triangles']:,} triangles: {row['wall_tile_ms']:.1f} ms per tile, {row['memory_bytes'] / MIB:.0f} MiB")
    finally:
        shutil.rmtree(workspace.root)
    _print(rows)
    if plots is not None:
        draw_plots(rows, plots)
    return rows


def _check_disk(folder: Path, millions: float) -> None:
    need = int(millions * 1e6 * BYTES_PER_TRIANGLE) + SPARE_BYTES
    folder.mkdir(parents=True, exist_ok=True)
    free = shutil.disk_usage(folder).free
    if free < need:
        raise SystemExit(f"bench: {folder} needs {need / 1e9:.0f} GB, but only {free / 1e9:.0f} GB are free")


def _create_district(workspace: Workspace, folder: Path) -> None:
    """Creates the scene of the district, once."""
    town, where = folder / "town", ["-w", str(workspace.root)]
    if not (town / "town.json").is_file():
        run_verb(["make-town", "-o", str(town), "--buildings", str(BUILDINGS), "--seed", "7", "--texture-px", str(TEXTURE_PX), "--no-trees"])
    for scene in ("district", "extent"):
        run_verb(["create-scene", scene, *where])
    run_verb(["add-files", "district", str(town), *where])


def _measure_size(workspace: Workspace, folder: Path, millions: float, blocks: int) -> Row:
    pitch_m = json.loads((folder / "town" / "town.json").read_text())["extent_m"]
    copies = DistrictCopier(workspace, "district", "extent", pitch_m)
    with workspace.open_catalogue() as catalogue:
        each = sum(asset.report["triangles"] for asset in catalogue.assets("district"))
        copied = len(catalogue.assets("extent")) // len(catalogue.assets("district"))
        count = max(1, round(millions * 1e6 / each))
        for number in range(copied, count):
            copies.add_copy(catalogue, number)
        _delete_build(workspace, catalogue)
    name, out, program = f"size-{count}", folder / "answer.json", ["-m", "bench.extent_programs"]
    built = _run_monitored([*program, "build", str(workspace.root), "extent"], folder)
    run_verb(["create-rendering", "extent", name, "--res", str(RES_M), "--view", "0/45", "--color", "jpeg", "-w", str(workspace.root)])
    work = _run_monitored([*program, "render", str(workspace.root), name, str(blocks), str(out)], folder)
    answer: Row = json.loads(out.read_text())
    out.unlink()
    figures = {f"build_{key}": value for key, value in asdict(built).items() if key in ("wall_s", "cpu_s", "memory_bytes", "anonymous_bytes")}
    sizes = {"millions": millions, "districts": count, "extent_m": pitch_m, "disk_bytes": built.disk_bytes}
    return {**sizes, **answer, **figures, "memory_bytes": work.memory_bytes, "anonymous_bytes": work.anonymous_bytes}


def _delete_build(workspace: Workspace, catalogue: Catalogue) -> None:
    """Deletes the built files, so the next build starts from scratch."""
    scene = workspace.scene_folder("extent")
    for name in ("chunks", "textures", "build"):
        shutil.rmtree(scene / name, ignore_errors=True)
    (scene / "scene.json").unlink(missing_ok=True)
    catalogue.set_built("extent", "")


def _run_monitored(words: list[str], folder: Path) -> ResourceUsage:
    figures = ResourceUsage()
    if run_monitored([sys.executable, *words], folder, figures) != 0:
        raise SystemExit(f"bench: {' '.join(words)} failed")
    return figures


COLUMNS = (
    "triangles, M",
    "build, CPU s per M",
    "build, MiB",
    "of it anonymous",
    "open, s",
    "plan, s",
    "base blocks",
    "render, MiB",
    "of it anonymous",
    "tile, ms",
    "CPU ms",
    "chunks missed",
    "textures missed",
)


def table_cells(row: Row) -> Iterator[str]:
    """Yields the cells of a row of the table."""
    million = row["triangles"] / 1e6
    yield f"{million:.1f}"
    yield f"{row['build_cpu_s'] / million:.2f}"
    yield f"{row['build_memory_bytes'] / MIB:,.0f}"
    yield f"{row['build_anonymous_bytes'] / MIB:,.0f}"
    yield f"{row['open_s']:.2f}"
    yield f"{row['plan_s']:.2f}"
    yield f"{row['base_blocks']:,}"
    yield f"{row['memory_bytes'] / MIB:,.0f}"
    yield f"{row['anonymous_bytes'] / MIB:,.0f}"
    yield f"{row['wall_tile_ms']:.1f}"
    yield f"{row['cpu_tile_ms']:.1f}"
    for what in ("chunk", "texture"):
        misses, hits = row[f"{what}_misses"], row[f"{what}_hits"]
        yield f"{misses:,} ({100 * misses / max(1, misses + hits):.2f} %)"


def _print(rows: list[Row]) -> None:
    table = Table(title=f"towns of growing extent, {BLOCKS} base blocks at {RES_M} m per pixel, two workers, 1 GiB", title_justify="left")
    for column in COLUMNS:
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(*table_cells(row))
    Console(width=200).print(table)
    for line in (COLUMNS, ["---"] * len(COLUMNS), *(list(table_cells(row)) for row in rows)):
        print(f"| {' | '.join(line)} |")


def draw_plots(rows: list[Row], folder: Path) -> None:
    x = [row["triangles"] / 1e6 for row in rows]

    def line(key: str, unit: float) -> list[tuple[float, float]]:
        return [(at, row[key] / unit) for at, row in zip(x, rows, strict=True)]

    label = "million triangles (logarithmic)"
    memory = {"render": "memory_bytes", "build": "build_memory_bytes", "build without mapped files": "build_anonymous_bytes"}
    lines = {name: line(key, MIB) for name, key in memory.items()}
    plot(folder / "extent-memory.svg", "Memory of all processes", label, "MiB", lines)
    plot(folder / "extent-time.svg", "A base tile with content", label, "ms", {"wall": line("wall_tile_ms", 1), "processor": line("cpu_tile_ms", 1)})
