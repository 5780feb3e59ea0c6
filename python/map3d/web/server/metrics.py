"""Metrics in Prometheus' text format, of all processes of a server together.

Each process counts in a memory-mapped file of its own, so that counting costs a fraction of a microsecond. The main process adds the files up and
serves the sums on a port of its own. The counts of a process that has ended stay in its file, so counters never decrease.
"""

import mmap
import os
import threading
from bisect import bisect_left
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from struct import unpack
from typing import Any, Final

ROUTES: Final = ("tile", "upload", "page")
CLASSES: Final = ("1xx", "2xx", "3xx", "4xx", "5xx")
BUCKETS_S: Final = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0)
COUNTERS: Final = {
    "tile_cache_hits_total": "Tiles served from the memory cache.",
    "on_demand_rendered_blocks_total": "Blocks rendered on demand.",
    "on_demand_evicted_blocks_total": "Blocks evicted from the on-demand cache.",
}
GAUGES: Final = {"requests_running": "Requests that are being answered.", "on_demand_waiting_blocks": "Blocks that requests wait for."}

_REQUESTS: Final = 0
_SECONDS: Final = _REQUESTS + len(ROUTES) * len(CLASSES)
_BUCKETS: Final = _SECONDS + len(ROUTES)
_COUNTERS: Final = _BUCKETS + len(ROUTES) * (len(BUCKETS_S) + 1)
_GAUGES: Final = _COUNTERS + len(COUNTERS)
_SIZE: Final = _GAUGES + len(GAUGES)


class Metrics:
    """The counts of this process. Threads may share it. Without a folder, counts stay in this process."""

    def __init__(self, folder: Path | None = None) -> None:
        self._lock = threading.Lock()
        if folder is None:
            self.values: Any = [0.0] * _SIZE
            return
        with (folder / f"{os.getpid()}").open("w+b") as file:
            file.truncate(8 * _SIZE)
            self.values = memoryview(mmap.mmap(file.fileno(), 8 * _SIZE)).cast("d")

    def begin(self) -> None:
        with self._lock:
            self.values[_GAUGES] += 1

    def end(self, route: int, status: int, seconds: float) -> None:
        """Counts a request that `begin` has counted. `route`: index in ROUTES."""
        values = self.values
        with self._lock:
            values[_GAUGES] -= 1
            values[route * 5 + status // 100 - 1] += 1
            values[_SECONDS + route] += seconds
            values[_BUCKETS + route * (len(BUCKETS_S) + 1) + bisect_left(BUCKETS_S, seconds)] += 1

    def set_counter(self, number: int, value: float) -> None:
        self.values[_COUNTERS + number] = value

    def set_waiting(self, value: float) -> None:
        self.values[_GAUGES + 1] = value


def render_metrics(folder: Path) -> str:
    """Returns the metrics of all processes that count in the folder. Gauges count processes that still run."""
    processes = list(_read(folder))
    total = [sum(values[number] for _, values in processes) for number in range(_GAUGES)]
    running = [values for is_running, values in processes if is_running]
    gauges = [sum(values[_GAUGES + number] for values in running) for number in range(len(GAUGES))]
    lines = ["# HELP map3d_processes Server processes that run.", "# TYPE map3d_processes gauge", f"map3d_processes {len(running)}"]
    lines += ["# HELP map3d_requests_total Answered requests.", "# TYPE map3d_requests_total counter"]
    for route, name in enumerate(ROUTES):
        counts = zip(CLASSES, total[_REQUESTS + route * len(CLASSES) :], strict=False)
        lines += [f'map3d_requests_total{{route="{name}",status="{kind}"}} {count:g}' for kind, count in counts]
    lines += ["# HELP map3d_request_seconds Time to the end of the answer.", "# TYPE map3d_request_seconds histogram"]
    for route, name in enumerate(ROUTES):
        lines += _histogram(name, total, route)
    for kind, names, values in (("counter", COUNTERS, total[_COUNTERS:]), ("gauge", GAUGES, gauges)):
        for (name, text), value in zip(names.items(), values, strict=True):
            lines += [f"# HELP map3d_{name} {text}", f"# TYPE map3d_{name} {kind}", f"map3d_{name} {value:g}"]
    return "\n".join(lines) + "\n"


def _histogram(name: str, total: list[float], route: int) -> Iterator[str]:
    first, seen = _BUCKETS + route * (len(BUCKETS_S) + 1), 0.0
    for bound, count in zip((*BUCKETS_S, "+Inf"), total[first:], strict=False):
        seen += count
        yield f'map3d_request_seconds_bucket{{route="{name}",le="{bound}"}} {seen:g}'
    yield f'map3d_request_seconds_sum{{route="{name}"}} {total[_SECONDS + route]:.6f}'
    yield f'map3d_request_seconds_count{{route="{name}"}} {seen:g}'


def _read(folder: Path) -> Iterator[tuple[bool, tuple[float, ...]]]:
    for path in sorted(folder.iterdir()):
        data = path.read_bytes()
        if len(data) == 8 * _SIZE:
            yield Path(f"/proc/{path.name}").exists(), unpack(f"{_SIZE}d", data)


class MetricsServer:
    """Serves the metrics of a folder in threads of this process."""

    def __init__(self, folder: Path, host: str, port: int) -> None:
        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                found = self.path.partition("?")[0] == "/metrics"
                body = render_metrics(folder).encode() if found else b"not found; the metrics are at /metrics\n"
                self.send_response(200 if found else 404)
                self.send_header("Content-Type", "text/plain; version=0.0.4; charset=utf-8" if found else "text/plain")
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, format: str, *args: Any) -> None:
                pass

        Handler.timeout = 10
        self._server = ThreadingHTTPServer((host, port), Handler)
        self._server.daemon_threads = True
        self.port = self._server.server_port
        self._thread = threading.Thread(target=self._server.serve_forever, name="metrics", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()
