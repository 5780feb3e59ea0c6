"""`python -m bench.serve`: cached tiles and a manifest from `map3d serve` beside nginx: same bytes, same machine, same run, one worker each.

nginx sends files with sendfile and without an access log; both have keep-alive connections from `wrk`. Pairs of runs alternate, so that both see
the same machine. Other programs disturb rates and latencies more than the CPU time
that a server takes for a request. Needs nginx and wrk (apt install nginx-light wrk).
"""

import argparse
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from map3d.catalogue import RenderingRecord, SceneCrs, SceneRecord, Workspace
from map3d.geometry.frames import pin
from map3d.tiles.block_versions import BlockVersions
from map3d.tiles.manifest import Manifest, ManifestCrs, ManifestView
from map3d.tiles.naming import block_levels
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoredTile, StoreShape
from map3d.types import BlockId, Layer, ViewAngles
from map3d.web.server.serve import find_port

from .process_time import tree_cpu_s
from .serve_flood import START_S, Flood, FloodedTiles, add_town, report_flood, town_view
from .serve_hostile import measure_refusals, report_refusals

SIZES: Final = {"10kB": 10_000, "50kB": 50_000}
CONNECTIONS: Final = 100
BOX: Final = ((0.0, 0.0, 0.0), (100.0, 100.0, 10.0))
Served = tuple["RunningServer", str]
"""A server and a path."""
_UNITS_MS: Final = {"us": 1e-3, "ms": 1.0, "s": 1e3}


@dataclass(frozen=True)
class Measured:
    """Requests a second, latencies, responses that were not 2xx or failed, and the number of requests."""

    rate: float
    p50_ms: float
    p99_ms: float
    errors: int
    requests: int


@dataclass(frozen=True)
class RunningServer:
    """`pid`: of the process whose descendants serve."""

    address: str
    pid: int

    def measure(self, path: str, seconds: int) -> tuple[Measured, float]:
        """Returns the measurement and the CPU time per request in microseconds."""
        before_s = tree_cpu_s(self.pid)
        found = measure(self.address + path, seconds)
        return found, (tree_cpu_s(self.pid) - before_s) / found.requests * 1e6


def make_workspace(root: Path) -> Workspace:
    """Creates a rendering whose layers have one tile of each size, of pseudo-random bytes, and its manifest."""
    workspace = Workspace(root / "workspace").create()
    layers = tuple(Layer(name.lower(), "color", "webp", 80) for name in SIZES)
    frames = tuple(pin(BOX, 256, 0.5, [ViewAngles(0, 45)]))
    record = RenderingRecord("r", "s", 0.5, (layers,), frames, BOX)
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("s", crs=SceneCrs(25832, "PROJCRS[…]", "UTM 32N"), origin=(0.0, 0.0, 0.0)))
    catalogue.create_rendering(record)
    catalogue.close()
    workspace.rendering_folder("r").mkdir(parents=True)
    with SqliteTileStore.create(workspace.store_path("r", "0-45"), StoreShape(record.tile_px, record.zmax, layers)) as store:
        top = block_levels(record.zmax)[-1].root
        tiles = [StoredTile(number, 0, 0, 0, os.urandom(size)) for number, size in enumerate(SIZES.values())]
        store.put_block(BlockId(top, 0, 0), "key", 1, tiles, b"seam")
    view = ManifestView(frames[0], Occupancy.from_tiles(record.zmax, [(0, 0)]), (BlockVersions(1),))
    manifest = Manifest(
        name="r", title="", attribution="", content_version=1, complete=True, crs=ManifestCrs("UTM 32N", 25832), origin=(0.0, 0.0, 0.0),
        box=BOX, passes=record.passes, views=(view,), objects=0,
    )  # fmt: skip
    workspace.manifest_path("r").write_bytes(manifest.dump())
    return workspace


@contextmanager
def map3d_server(workspace: Workspace) -> Iterator[RunningServer]:
    command = [sys.executable, "-m", "map3d", "serve", "-w", str(workspace.root), "--port", "0", "--no-worker"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"})
    try:
        assert process.stdout is not None
        found = re.search(r"http://[^\s/]+", process.stdout.readline())
        assert found, "the server did not start"
        yield RunningServer(found[0], process.pid)
    finally:
        process.terminate()
        process.wait()


@contextmanager
def nginx_server(root: Path, folder: Path) -> Iterator[RunningServer]:
    port = find_port("127.0.0.1", 0)
    config = root / "nginx.conf"
    config.write_text(
        f"worker_processes 1;\npid {root}/nginx.pid;\nerror_log {root}/error.log;\nevents {{ worker_connections 1024; }}\nhttp {{\n"
        f"  access_log off; sendfile on; tcp_nopush on; keepalive_requests 100000000; default_type image/webp;\n"
        f"  server {{ listen 127.0.0.1:{port}; root {folder}; add_header Cache-Control 'public, max-age=31536000, immutable'; }}\n}}\n"
    )
    process = subprocess.Popen([nginx(), "-c", str(config), "-g", "daemon off; user root;" if os.geteuid() == 0 else "daemon off;"])
    try:
        yield RunningServer(f"http://127.0.0.1:{port}", process.pid)
    finally:
        process.terminate()
        process.wait()


def nginx() -> str:
    return shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin") or sys.exit("nginx is missing; apt install nginx-light")


def measure(url: str, seconds: int) -> Measured:
    """Runs wrk with one thread and CONNECTIONS connections."""
    command = ["wrk", "-t1", f"-c{CONNECTIONS}", f"-d{seconds}s", "--latency", "--timeout", "30s", url]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    latencies = {name: float(value) * _UNITS_MS[unit] for name, value, unit in re.findall(r"^\s+(50|99)%\s+([\d.]+)(us|ms|s)$", text, re.MULTILINE)}
    rate = re.search(r"Requests/sec:\s+([\d.]+)", text)
    failed = re.search(r"Non-2xx or 3xx responses: (\d+)", text)
    broken = re.search(r"Socket errors: connect (\d+), read (\d+), write (\d+), timeout (\d+)", text)
    requests = re.search(r"(\d+) requests in", text)
    assert rate, text
    assert requests, text
    errors = (int(failed[1]) if failed else 0) + (sum(map(int, broken.groups())) if broken else 0)
    return Measured(float(rate[1]), latencies["50"], latencies["99"], errors, int(requests[1]))


def fetch(url: str) -> bytes:
    """Waits until the server answers."""
    deadline_s = time.monotonic() + 30
    while True:
        try:
            with urllib.request.urlopen(url) as response:
                return bytes(response.read())
        except OSError:
            if time.monotonic() > deadline_s:
                raise
            time.sleep(0.05)


def compare(name: str, ours: Served, theirs: Served, pairs: int, seconds: int, report: Callable[[str], None]) -> dict[str, object]:
    """Measures alternating pairs; returns and reports rates, latencies, CPU times and the median ratios."""
    assert fetch(ours[0].address + ours[1]) == fetch(theirs[0].address + theirs[1]), f"{name}: the servers do not send the same bytes"
    rows = []
    for number in range(pairs):
        order = (ours, theirs) if number % 2 == 0 else (theirs, ours)
        found = [server.measure(path, seconds) for server, path in order]
        rows.append(found if number % 2 == 0 else found[::-1])
    both = []
    for side, who in enumerate(("map3d", "nginx")):
        rate, p50, p99 = (statistics.median(getattr(row[side][0], what) for row in rows) for what in ("rate", "p50_ms", "p99_ms"))
        cpu_us = statistics.median(row[side][1] for row in rows)
        report(f"{name:9} {who:6} {rate:9,.0f} requests/s   p50 {p50:7.2f} ms   p99 {p99:7.2f} ms   CPU {cpu_us:6.1f} µs/request")
        both.append([rate, p50, p99, cpu_us])
    errors = sum(measured.errors for row in rows for measured, _ in row)
    rates = sorted(one.rate / other.rate for (one, _), (other, _) in rows)
    shares = sorted(theirs_us / ours_us for (_, ours_us), (_, theirs_us) in rows)
    for what, ratios in (("rate", rates), ("CPU", shares)):
        spread = f"least {ratios[0]:.2f}, greatest {ratios[-1]:.2f}"
        report(f"{name:9} {what} ratio  median {statistics.median(ratios):.2f} ({spread}) of {pairs} pairs; {errors} errors")
    return {"name": name, "map3d": both[0], "nginx": both[1], "ratios": rates, "cpu_ratios": shares, "errors": errors}


def measure_flood(root: Path, workspace: Workspace, seconds: int, report: Callable[[str], None]) -> list[dict[str, object]]:
    """Measures hostile requests, and a cached tile without and with a flood of views, in a server of its own."""
    add_town(workspace, root / "town")
    view = town_view(workspace)
    with map3d_server(workspace) as server:
        address = server.address
        refusals = report_refusals(measure_refusals(address, view[0] % view[1]), report)
        tile = f"{address}/tiles/r/0-45/10kb/0/0/0?v=1"
        fetch(tile)
        fetch(address + view[0] % view[1])
        alone = measure(tile, seconds)
        with Flood(address, view, root, START_S + 2 * seconds + 60) as views:
            time.sleep(START_S)
            busy = measure(tile, seconds)
    answers = (views.computed, views.refused, views.other)
    found = FloodedTiles(alone.rate, alone.p99_ms, busy.rate, busy.p50_ms, busy.p99_ms, busy.errors, *answers)
    report_flood(found, report)
    return [{"name": "hostile", "requests": refusals}, {"name": "flood", **asdict(found)}]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.serve", description=__doc__)
    parser.add_argument("--pairs", type=int, default=10)
    parser.add_argument("--seconds", type=int, default=5, help="length of a run")
    parser.add_argument("--no-flood", action="store_true", help="leave out views and hostile requests")
    parser.add_argument("--json", type=Path, help="file for the results")
    given = parser.parse_args()
    if shutil.which("wrk") is None:
        sys.exit("wrk is missing; apt install wrk")
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        root.chmod(0o755)
        workspace = make_workspace(root)
        files = root / "files"
        files.mkdir()
        with map3d_server(workspace) as ours, nginx_server(root, files) as theirs:
            paths = {name: f"/tiles/r/0-45/{name.lower()}/0/0/0?v=1" for name in SIZES} | {"manifest": "/tiles/r/rendering.json"}
            results: list[dict[str, object]] = []
            for name, path in paths.items():
                (files / name).write_bytes(fetch(ours.address + path))
                results.append(compare(name, (ours, path), (theirs, f"/{name}"), given.pairs, given.seconds, print))
        if not given.no_flood:
            results += measure_flood(root, workspace, given.seconds, print)
    if given.json is not None:
        given.json.write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
