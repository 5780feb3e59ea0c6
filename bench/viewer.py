"""map3d.js beside CesiumJS, OpenSeadragon and Leaflet: `make bench-viewer`, `python -m bench viewer [--quick]`.

The cities come from bench/city.py, their 3D Tiles from bench/tiles3d.py; bench/viewer/run.mjs drives Chromium and writes a line for every sample,
so that an interrupted run goes on where it was. Peers are npm packages in bench/viewer; without them only map3d.js is measured, and that is said.
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

from .city import PLACE_M, RINGS, City, made
from .tiles3d import tileset

HERE = Path(__file__).parent / "viewer"
MIB = 1 << 20
FIRST_BYTES, MEMORY_BYTES, LESS_CPU, BYTES_SPAN, CPU_SPAN = 1_000_000, 150_000_000, 5.0, 0.05, 0.2
"""The goals: a first view, memory after five minutes, CesiumJS's processor time a frame over ours, how far figures may differ as a city grows."""
Row = dict[str, Any]


@dataclass(frozen=True)
class Wish:
    """What to measure. `length`: steps of a path; `use_s`, `idle_s`: seconds of use before memory is read, and of nothing after it;
    `free`: pictures are not held back to the screen's pace (see measures.mjs)."""

    cities: tuple[str, ...] = tuple(RINGS)
    reps: int = 5
    length: int = 24
    use_s: int = 300
    idle_s: int = 60
    peers: bool = True
    free: bool = False
    only: tuple[str, ...] | None = None


QUICK = Wish(cities=("1e4",), reps=1, length=8, use_s=5, idle_s=5, peers=False)


def measure(quick: bool, reps: int, folder: Path, only: tuple[str, ...] | None, free: bool) -> list[Row]:
    """All samples; the tables are printed. `only`: measures (see run.mjs)."""
    wish = QUICK if quick else Wish(reps=reps, peers=peers(), only=only, free=free)
    cities = list(made(folder, wish.cities))
    middle = cities[min(2, len(cities) - 1)]
    if wish.peers:
        for city in cities:
            tileset(city)
        tileset(middle, far=True)
    samples = _samples(cities, wish, folder)
    _print(samples, cities, middle)
    return samples


def peers() -> bool:
    """Are they installed? Says so when not."""
    if (HERE / "node_modules" / "cesium").is_dir():
        return True
    print(
        f"bench: NO PEERS: CesiumJS, OpenSeadragon and Leaflet are not installed; `npm ci --ignore-scripts` in {HERE} installs them", file=sys.stderr
    )
    return False


def _samples(cities: list[City], wish: Wish, folder: Path) -> list[Row]:
    out = folder / ("quick.jsonl" if wish == QUICK else "samples.jsonl")
    if wish == QUICK:
        out.unlink(missing_ok=True)
    asked = {
        "work": str(folder.absolute()),
        "out": str(out.absolute()),
        "peers": wish.peers,
        "cities": wish.cities,
        "width_m": {city.name: PLACE_M * (2 * RINGS[city.name] + 1) for city in cities},
        "reps": wish.reps,
        "length": wish.length,
        "use_s": wish.use_s,
        "idle_s": wish.idle_s,
        "only": wish.only,
        "free": wish.free,
        "pictures": wish.peers and wish.only is None,
    }
    if shutil.which("node") is None:
        raise SystemExit("bench: needs Node.js")
    if subprocess.run(["node", str(HERE / "run.mjs")], input=json.dumps(asked), text=True, check=False).returncode != 0:
        raise SystemExit("bench: bench/viewer/run.mjs failed; the same command again goes on where it was")
    return [json.loads(line) for line in out.read_text().splitlines()]


@dataclass(frozen=True)
class Samples:
    """Medians over samples of one measure."""

    rows: list[Row]

    def of(self, measure: str, viewer: str, city: str) -> list[Row]:
        return [row for row in self.rows if (row["measure"], row["viewer"], row["city"]) == (measure, viewer, city)]

    def median(self, measure: str, viewer: str, city: str, *path: str) -> float | None:
        values = [_at(row, path) for row in self.of(measure, viewer, city)]
        return statistics.median(values) if values else None

    def viewers(self, measure: str) -> list[str]:
        return list(dict.fromkeys(row["viewer"] for row in self.rows if row["measure"] == measure))

    def ratio(self, measure: str, viewer: str, city: str, *path: str) -> float | None:
        """A viewer's over ours, of as many pixels where both were measured: median over the rounds."""
        ours = self.of(measure, "map3d-css" if viewer.endswith("-css") else "map3d", city) or self.of(measure, "map3d", city)
        pairs = list(zip(self.of(measure, viewer, city), ours, strict=False))
        return statistics.median(_at(theirs, path) / _at(ours, path) for theirs, ours in pairs) if pairs else None


def _at(row: Row, path: Iterable[str]) -> float:
    value: Any = row
    for key in path:
        value = value[key]
    return float(value)


def _number(value: float | None, form: str = "{:,.0f}") -> str:
    return "" if value is None else form.format(value)


Column = tuple[str, Callable[[str, str], str]]


def _print(rows: list[Row], cities: list[City], middle: City) -> None:
    samples, names = Samples(rows), [city.name for city in cities]
    triangles = {city.name: city.triangles for city in cities}
    loads = [row["load"] for row in rows]
    print(f"load of {os.cpu_count()} cores: {min(loads):.1f} to {max(loads):.1f}, median {statistics.median(loads):.1f}\n")
    for title, measure, columns in _tables(samples):
        shown = [(viewer, name) for viewer in samples.viewers(measure) for name in names if samples.of(measure, viewer, name)]
        if shown:
            _table(title, ["viewer", "triangles", "rounds", *(name for name, _ in columns)]).fill(
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
            return _number(None if value is None else value / unit, form)

        return cell

    def ratio(measure: str, *path: str) -> Callable[[str, str], str]:
        return lambda viewer, city: "" if viewer.startswith("map3d") else _number(samples.ratio(measure, viewer, city, *path), "{:.1f}")

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
            ("CPU a frame, ms", plain(measure, "{:.1f}", "cpu_ms")),
            ("ratio", ratio(measure, "cpu_ms")),
            ("of it the page, ms", plain(measure, "{:.1f}", "page_ms")),
            ("ratio ", ratio(measure, "page_ms")),
            ("frame p50, ms", plain(measure, "{:.0f}", "p50_ms")),
            ("p95, ms", plain(measure, "{:.0f}", "p95_ms")),
        ]

    stays: list[Column] = [
        ("use, s", plain("stays", "{:.0f}", "use_s")),
        ("PSS, MB", plain("stays", "{:.0f}", "used", "pss", unit=1e6)),
        ("beyond the empty page, MB", plain("stays", "{:.0f}", "beyond", "pss", unit=1e6)),
        ("of it no files", plain("stays", "{:.0f}", "beyond", "anonymous", unit=1e6)),
        ("after the minute, MB", plain("stays", "{:.0f}", "rested", "pss", unit=1e6)),
        ("idle frames", plain("stays", "{:.0f}", "idle", "frames")),
        ("requests", plain("stays", "{:.0f}", "idle", "requests")),
        ("CPU, ms/s", plain("stays", "{:.0f}", "idle", "cpu_ms_per_s")),
    ]
    return [
        ("first complete view of the district", "first", first("first")),
        ("the same over 10 Mbit/s, 40 ms", "first-network", first("first-network")),
        ("the district: pan, zoom, turn", "frames", frames("frames")),
        ("all of the city in view", "whole", frames("whole")),
        ("colour pyramid: first complete view", "color-first", first("color-first")),
        ("colour pyramid: pan", "color-frames", frames("color-frames")),
        ("memory, and a minute of nothing", "stays", stays),
    ]


class _table:
    """Printed on the terminal, then as Markdown."""

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
    """A line for each goal that could be measured: kept or missed."""
    lines = []

    def say(what: str, value: float | None, kept: Callable[[float], bool], form: str) -> None:
        if value is not None:
            lines.append(f"{'kept  ' if kept(value) else 'MISSED'} {what}: {form.format(value)}")

    say("first view at most 1 MB", samples.median("first", "map3d", middle, "bytes"), lambda value: value <= FIRST_BYTES, "{:,.0f} bytes")
    for measure, what in (("frames", "the district"), ("whole", "all of it in view")):
        for viewer in ("cesium", "cesium-css"):
            value = samples.ratio(measure, viewer, middle, "cpu_ms")
            say(f"five times less CPU a frame than {viewer}, {what}", value, lambda value: value >= LESS_CPU, "{:.1f} times")
    say("memory at most 150 MB", samples.median("stays", "map3d", middle, "beyond", "pss"), lambda value: value <= MEMORY_BYTES, "{:,.0f} bytes")
    for what, measure, whose, path, span in (
        ("bytes", "first", "map3d", ("bytes",), BYTES_SPAN),
        ("requests", "first", "map3d", ("requests",), BYTES_SPAN),
        ("CPU a frame", "frames", "map3d-css", ("cpu_ms",), CPU_SPAN),
    ):
        values = [value for name in names if (value := samples.median(measure, whose, name, *path)) is not None]
        if len(values) > 1:
            spread = max(abs(value / values[0] - 1) for value in values)
            say(f"{what} the same as the city grows, within {span:.0%}", spread, lambda value, span=span: value <= span, "{:.1%}")
    for viewer in ("openseadragon", "leaflet"):
        for what, measure, path in (("time to the view", "color-first", ("ms",)), ("frame p95", "color-frames", ("p95_ms",))):
            say(
                f"{what} at least as good as {viewer}'s",
                samples.ratio(measure, viewer, middle, *path),
                lambda value: value >= 1,
                "theirs is {:.2f} of ours",
            )
    for what in ("frames", "requests"):
        say(f"idle: no {what}", samples.median("stays", "map3d", middle, "idle", what), lambda value: value == 0, "{:.0f}")
    return lines
