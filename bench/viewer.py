"""Compares map3d.js with CesiumJS, OpenSeadragon and Leaflet: `make bench-viewer`, `python -m bench viewer [--quick]`.

The cities come from bench/city.py, their 3D Tiles from bench/tiles3d.py; bench/viewer/run.mjs drives Chromium and writes a line for every sample,
so an interrupted run can be resumed. Peers are npm packages in bench/viewer; without them it prints a warning and measures map3d.js only.
"""

import json
import os
import shutil
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from .city import CELL_M, RINGS, City, publish_cities
from .tiles3d import tileset

HERE = Path(__file__).parent / "viewer"
MIB = 1 << 20
FIRST_BYTES, MEMORY_BYTES, LESS_CPU, BYTES_SPAN, CPU_SPAN = 1_000_000, 150_000_000, 5.0, 0.05, 0.2
"""Goals: bytes of a first view, memory after use, CesiumJS's CPU time per frame over ours, changes with the size of the city."""
SampleRow = dict[str, Any]


@dataclass(frozen=True)
class ViewerRun:
    """Options of a run. `length`: steps of a path; `use_s`, `idle_s`: seconds of use before, and of idling after memory is measured; `free`: frames
    are not limited to the screen's rate (see measures.mjs)."""

    cities: tuple[str, ...] = tuple(RINGS)
    reps: int = 5
    length: int = 24
    use_s: int = 300
    idle_s: int = 60
    peers: bool = True
    free: bool = False
    only: tuple[str, ...] | None = None


QUICK = ViewerRun(cities=("1e4",), reps=1, length=8, use_s=5, idle_s=5, peers=False)


def measure(quick: bool, reps: int, folder: Path, only: tuple[str, ...] | None, free: bool) -> list[SampleRow]:
    """Takes all samples and prints the tables. `only`: names of measures (see run.mjs)."""
    run = QUICK if quick else ViewerRun(reps=reps, peers=peers_installed(), only=only, free=free)
    cities = list(publish_cities(folder, run.cities))
    middle = cities[min(2, len(cities) - 1)]
    if run.peers:
        for city in cities:
            tileset(city)
        tileset(middle, far=True)
    samples = _take_samples(cities, run, folder)
    _print(samples, cities, middle)
    return samples


def peers_installed() -> bool:
    """Returns whether the peers are installed; prints a warning if not."""
    if (HERE / "node_modules" / "cesium").is_dir():
        return True
    print(
        f"bench: NO PEERS: CesiumJS, OpenSeadragon and Leaflet are not installed; `npm ci --ignore-scripts` in {HERE} installs them", file=sys.stderr
    )
    return False


def _take_samples(cities: list[City], run: ViewerRun, folder: Path) -> list[SampleRow]:
    out = folder / ("quick.jsonl" if run == QUICK else "samples.jsonl")
    if run == QUICK:
        out.unlink(missing_ok=True)
    asked = {
        "work": str(folder.absolute()),
        "out": str(out.absolute()),
        "peers": run.peers,
        "cities": run.cities,
        "width_m": {city.name: CELL_M * (2 * RINGS[city.name] + 1) for city in cities},
        "reps": run.reps,
        "length": run.length,
        "use_s": run.use_s,
        "idle_s": run.idle_s,
        "only": run.only,
        "free": run.free,
        "pictures": run.peers and run.only is None,
    }
    if shutil.which("node") is None:
        raise SystemExit("bench: Node.js is not installed")
    if subprocess.run(["node", str(HERE / "run.mjs")], input=json.dumps(asked), text=True, check=False).returncode != 0:
        raise SystemExit("bench: bench/viewer/run.mjs failed; re-run to resume")
    return [json.loads(line) for line in out.read_text().splitlines()]


@dataclass(frozen=True)
class Samples:
    """All samples, with medians per measure, viewer and city."""

    rows: list[SampleRow]

    def of(self, measure: str, viewer: str, city: str) -> list[SampleRow]:
        return [row for row in self.rows if (row["measure"], row["viewer"], row["city"]) == (measure, viewer, city)]

    def median(self, measure: str, viewer: str, city: str, *path: str) -> float | None:
        values = [_value_at(row, path) for row in self.of(measure, viewer, city)]
        return statistics.median(values) if values else None

    def viewers(self, measure: str) -> list[str]:
        return list(dict.fromkeys(row["viewer"] for row in self.rows if row["measure"] == measure))

    def ratio(self, measure: str, viewer: str, city: str, *path: str) -> float | None:
        """Returns the median over the rounds of a viewer's figure over ours, at the same resolution if measured."""
        ours = self.of(measure, "map3d-css" if viewer.endswith("-css") else "map3d", city) or self.of(measure, "map3d", city)
        pairs = list(zip(self.of(measure, viewer, city), ours, strict=False))
        return statistics.median(_value_at(theirs, path) / _value_at(ours, path) for theirs, ours in pairs) if pairs else None


def _value_at(row: SampleRow, path: Iterable[str]) -> float:
    value: Any = row
    for key in path:
        value = value[key]
    return float(value)


def _format(value: float | None, form: str = "{:,.0f}") -> str:
    return "" if value is None else form.format(value)


Column = tuple[str, Callable[[str, str], str]]


def _print(rows: list[SampleRow], cities: list[City], middle: City) -> None:
    samples, names = Samples(rows), [city.name for city in cities]
    triangles = {city.name: city.triangles for city in cities}
    loads = [row["load"] for row in rows]
    print(f"load of {os.cpu_count()} cores: {min(loads):.1f} to {max(loads):.1f}, median {statistics.median(loads):.1f}\n")
    for title, measure, columns in _tables(samples):
        shown = [(viewer, name) for viewer in samples.viewers(measure) for name in names if samples.of(measure, viewer, name)]
        if shown:
            MarkdownTable(title, ["viewer", "triangles", "rounds", *(name for name, _ in columns)]).fill(
                [
                    [viewer, f"{triangles[name]:,}", str(len(samples.of(measure, viewer, name))), *(cell(viewer, name) for _, cell in columns)]
                    for viewer, name in shown
                ]
            )
    for line in goals(samples, names, middle.name):
        print(line)


def _tables(samples: Samples) -> list[tuple[str, str, list[Column]]]:
    def plain(measure: str, form: str, *path: str, unit: float = 1) -> Callable[[str, str], str]:
        def cell(viewer: str, city: str) -> str:
            value = samples.median(measure, viewer, city, *path)
            return _format(None if value is None else value / unit, form)

        return cell

    def ratio(measure: str, *path: str) -> Callable[[str, str], str]:
        return lambda viewer, city: "" if viewer.startswith("map3d") else _format(samples.ratio(measure, viewer, city, *path), "{:.1f}")

    def first(measure: str) -> list[Column]:
        return [
            ("bytes", plain(measure, "{:,.0f}", "bytes")),
            ("requests", plain(measure, "{:.0f}", "requests")),
            ("CPU, ms", plain(measure, "{:,.0f}", "cpu_ms")),
            ("ratio", ratio(measure, "cpu_ms")),
            ("time, ms", plain(measure, "{:,.0f}", "ms")),
            ("ratio ", ratio(measure, "ms")),
        ]

    def frames(measure: str) -> list[Column]:
        return [
            ("CPU per frame, ms", plain(measure, "{:.1f}", "cpu_ms")),
            ("ratio", ratio(measure, "cpu_ms")),
            ("page only, ms", plain(measure, "{:.1f}", "page_ms")),
            ("ratio ", ratio(measure, "page_ms")),
            ("frame p50, ms", plain(measure, "{:.0f}", "p50_ms")),
            ("p95, ms", plain(measure, "{:.0f}", "p95_ms")),
        ]

    stays: list[Column] = [
        ("use, s", plain("stays", "{:.0f}", "use_s")),
        ("PSS, MB", plain("stays", "{:.0f}", "used", "pss", unit=1e6)),
        ("beyond the empty page, MB", plain("stays", "{:.0f}", "beyond", "pss", unit=1e6)),
        ("of it anonymous, MB", plain("stays", "{:.0f}", "beyond", "anonymous", unit=1e6)),
        ("after idling, MB", plain("stays", "{:.0f}", "rested", "pss", unit=1e6)),
        ("idle frames", plain("stays", "{:.0f}", "idle", "frames")),
        ("requests", plain("stays", "{:.0f}", "idle", "requests")),
        ("CPU, ms/s", plain("stays", "{:.0f}", "idle", "cpu_ms_per_s")),
    ]
    return [
        ("first complete view of the district", "first", first("first")),
        ("first complete view over 10 Mbit/s, 40 ms", "first-network", first("first-network")),
        ("the district: pan, zoom, turn", "frames", frames("frames")),
        ("whole city in view", "whole", frames("whole")),
        ("colour pyramid: first complete view", "color-first", first("color-first")),
        ("colour pyramid: pan", "color-frames", frames("color-frames")),
        ("memory after use and after a minute idle", "stays", stays),
    ]


class MarkdownTable:
    """A table, printed for the terminal, then as Markdown."""

    def __init__(self, title: str, columns: list[str]) -> None:
        self.title, self.columns = title, columns

    def fill(self, rows: list[list[str]]) -> None:
        table = Table(title=self.title, title_justify="left")
        for column in self.columns:
            table.add_column(column.strip(), justify="right")
        for row in rows:
            table.add_row(*row)
        Console(width=200).print(table)
        for line in ([column.strip() for column in self.columns], ["---"] * len(self.columns), *rows):
            print(f"| {' | '.join(line)} |")
        print()


def goals(samples: Samples, names: list[str], middle: str) -> list[str]:
    """Returns a line for each measured goal: kept or missed."""
    lines = []

    def add_line(what: str, value: float | None, kept: Callable[[float], bool], form: str) -> None:
        if value is not None:
            lines.append(f"{'kept  ' if kept(value) else 'MISSED'} {what}: {form.format(value)}")

    add_line("first view at most 1 MB", samples.median("first", "map3d", middle, "bytes"), lambda value: value <= FIRST_BYTES, "{:,.0f} bytes")
    for measure, what in (("frames", "the district"), ("whole", "whole city in view")):
        for viewer in ("cesium", "cesium-css"):
            value = samples.ratio(measure, viewer, middle, "cpu_ms")
            add_line(f"five times less CPU per frame than {viewer}, {what}", value, lambda value: value >= LESS_CPU, "{:.1f} times")
    add_line("memory at most 150 MB", samples.median("stays", "map3d", middle, "beyond", "pss"), lambda value: value <= MEMORY_BYTES, "{:,.0f} bytes")
    for what, measure, whose, path, span in (
        ("bytes", "first", "map3d", ("bytes",), BYTES_SPAN),
        ("requests", "first", "map3d", ("requests",), BYTES_SPAN),
        ("CPU per frame", "frames", "map3d-css", ("cpu_ms",), CPU_SPAN),
    ):
        values = [value for name in names if (value := samples.median(measure, whose, name, *path)) is not None]
        if len(values) > 1:
            spread = max(abs(value / values[0] - 1) for value in values)
            add_line(f"{what} the same as the city grows, within {span:.0%}", spread, lambda value, span=span: value <= span, "{:.1%}")
    for viewer in ("openseadragon", "leaflet"):
        for what, measure, path in (("time to the view", "color-first", ("ms",)), ("frame p95", "color-frames", ("p95_ms",))):
            add_line(
                f"{what} at least as good as {viewer}'s",
                samples.ratio(measure, viewer, middle, *path),
                lambda value: value >= 1,
                "theirs is {:.2f} of ours",
            )
    for what in ("frames", "requests"):
        add_line(f"idle: no {what}", samples.median("stays", "map3d", middle, "idle", what), lambda value: value == 0, "{:.0f}")
    return lines
