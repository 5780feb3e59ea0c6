"""Whole renders of a town beside those of another version of map3d: `python -m bench render --against FOLDER`.

FOLDER is a checkout with a compiled core (`make build`), or one of its copies. Both versions import and render the same town in turn, each in a
workspace of its own, since a newer version migrates the catalogue; their tiles are compared.
"""

import hashlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from map3d.catalogue import Workspace
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import content_hash

from .benchmark_scene import CACHE, run_verb
from .peers import FrameFields

HERE = Path(__file__).parents[1]
GOAL = 2.5
"""The goal for base tiles per CPU second, relative to the older version."""
_MAP3D = "from map3d.cli import main; main()"


@dataclass(frozen=True)
class RenderCost:
    """The cost of one `map3d render`, subprocesses included."""

    cpu_s: float
    user_s: float
    wall_s: float
    page_faults: int
    base_tiles: int
    decoded: int
    """Number of decoded source images."""

    @property
    def cpu_ms(self) -> float:
        """CPU time per base tile."""
        return 1000 * self.cpu_s / self.base_tiles

    @property
    def faults(self) -> float:
        """Page faults per base tile."""
        return self.page_faults / self.base_tiles


@dataclass(frozen=True)
class RenderOptions:
    """The town and the rendering. `res_m`: metres per pixel; `pitch_deg`: of the view if there is one direction, which looks north."""

    buildings: int = 300
    res_m: float = 0.1
    directions: int = 1
    color: str = "webp"
    workers: int = 2
    trees: bool = True
    pitch_deg: float = 45.0


def measure(against: Path | None, pairs: int, options: RenderOptions) -> list[dict[str, Any]]:
    """Renders the town `pairs` times with each version in turn and prints medians and ranges. Fails when their tiles differ."""
    roots = {"now": HERE} if against is None else {"before": against.resolve(), "now": HERE}
    versions = {name: RenderBenchmark(root, options) for name, root in roots.items()}
    for name, bench in versions.items():
        bench.render(f"warm-{name}")
    costs: dict[str, list[RenderCost]] = {name: [] for name in versions}
    tiles: dict[str, dict[str, str]] = {}
    for _ in range(pairs):
        for name, bench in versions.items():
            cost, found = bench.render(name)
            costs[name].append(cost)
            tiles.setdefault(name, found)
    equal = all(found == tiles["now"] for found in tiles.values())
    _print(costs, options, len(tiles["now"]))
    if not equal:
        raise SystemExit(f"bench: the versions' tiles differ: {_differing(tiles)}")
    return [{"version": name, **asdict(cost)} for name, found in costs.items() for cost in found]


class RenderBenchmark:
    """The town, and its scene in a workspace of the version in `root`, made once."""

    def __init__(self, root: Path, options: RenderOptions) -> None:
        self._root, self._options = root, options
        folder = CACHE / f"render-{options.buildings}{'' if options.trees else '-bare'}"
        if not (folder / "town").is_dir():
            trees = [] if options.trees else ["--no-trees"]
            run_verb(["make-town", "-o", str(folder / "town"), "--buildings", str(options.buildings), "--seed", "7", *trees])
        self._workspace = Workspace(folder / f"workspace-{hashlib.sha256(str(root).encode()).hexdigest()[:8]}")
        self._where = ["-w", str(self._workspace.root.absolute())]
        if not self._workspace.root.is_dir():
            self._run(["create-workspace", *self._where])
            self._run(["create-scene", "town", *self._where])
            self._run(["add-files", "town", str((folder / "town").absolute()), *self._where])

    @contextmanager
    def rendering(self, name: str) -> Iterator[None]:
        """Creates a rendering, and removes it at the end."""
        view = ["--view", f"0/{self._options.pitch_deg:g}"] if self._options.directions == 1 else ["--directions", str(self._options.directions)]
        color = ["--color", self._options.color, "--res", str(self._options.res_m)]
        self._run(["create-rendering", "town", name, *view, *color, *self._where])
        try:
            yield
        finally:
            self._run(["remove-rendering", name, "--yes", *self._where])

    def frame(self, name: str) -> tuple[Path, FrameFields]:
        """Returns the scene's folder and the fields of the frame of a rendering's first view."""
        with self._workspace.open_catalogue() as catalogue:
            track = catalogue.rendering(name).tracks[0]
            return self._workspace.root / "scenes" / "town", track.frame.to_json(track.layers)

    def render(self, name: str) -> tuple[RenderCost, dict[str, str]]:
        """Returns the cost of a render, and the hash of each tile by store, layer and number."""
        with self.rendering(name):
            return self._render(name)

    def _render(self, name: str) -> tuple[RenderCost, dict[str, str]]:
        workers = ["--workers", str(self._options.workers)]
        begun = time.perf_counter()
        output, usage = self._run(["render", name, "--json", "--stats", *workers, *self._where])
        wall_s = time.perf_counter() - begun
        report = json.loads(output)
        tiles = _hashes(self._workspace.rendering_folder(name))
        cost = RenderCost(
            cpu_s=usage.ru_utime + usage.ru_stime,
            user_s=usage.ru_utime,
            wall_s=wall_s,
            page_faults=usage.ru_minflt,
            base_tiles=report["statistics"]["base_tiles"],
            decoded=report["stats"]["caches"]["texture"]["decoded"],
        )
        return cost, tiles

    def _run(self, arguments: Sequence[str]) -> tuple[str, Any]:
        """Returns the output of a verb and the resource usage of its whole process tree."""
        environment = os.environ | {"PYTHONPATH": str(self._root / "python")}
        with tempfile.TemporaryFile() as out:
            process = subprocess.Popen([sys.executable, "-c", _MAP3D, *arguments], stdout=out, stderr=subprocess.DEVNULL, env=environment)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            out.seek(0)
            text = out.read().decode()
        if process.returncode != 0:
            raise SystemExit(f"bench: map3d {' '.join(arguments)} with {self._root} failed: {text[-500:]}")
        return text, usage


def _hashes(folder: Path) -> dict[str, str]:
    found = {}
    for path in sorted(folder.glob("*.sqlite")):
        with SqliteTileStore(path, read_only=True) as store:
            for number, layer in enumerate(store.shape.layers):
                for tile in store.list_tiles(number):
                    found[f"{path.stem} {layer.name} {tile}"] = content_hash(store.get_tile(number, *tile) or b"").hex()
    return found


def _differing(tiles: dict[str, dict[str, str]]) -> str:
    before, now = tiles["before"], tiles["now"]
    different = sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))
    return f"{len(different)} of {len(before.keys() | now.keys())}, e.g. {different[0]}"


def _print(costs: dict[str, list[RenderCost]], options: RenderOptions, images: int) -> None:
    first = costs["now"][0]
    table = Table(title=f"render of {first.base_tiles:,} base tiles, {images:,} images, {options}; medians (least to greatest)", title_justify="left")
    for column in ("version", "CPU ms per base tile", "user", "page faults per base tile", "decoded", "wall s", "renders"):
        table.add_column(column, justify="left" if column == "version" else "right")
    for name, found in costs.items():
        cells = (
            _spread([cost.cpu_ms for cost in found], 2),
            _spread([1000 * cost.user_s / cost.base_tiles for cost in found], 2),
            _spread([cost.faults for cost in found], 0),
            _spread([cost.decoded for cost in found], 0),
            _spread([cost.wall_s for cost in found], 1),
        )
        table.add_row(name, *cells, str(len(found)))
    Console(width=160).print(table)
    if "before" in costs:
        ratios = [before.cpu_s / now.cpu_s for before, now in zip(costs["before"], costs["now"], strict=True)]
        verdict = "met" if statistics.median(ratios) >= GOAL else "missed"
        print(f"CPU time before / now, pair by pair: {_spread(ratios, 2)}; goal {GOAL}: {verdict}")


def _spread(values: Sequence[float], digits: int) -> str:
    least, greatest = min(values), max(values)
    return f"{statistics.median(values):,.{digits}f} ({least:,.{digits}f} to {greatest:,.{digits}f})"
