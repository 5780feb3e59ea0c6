"""Hostile requests, refused with 400: `python -m bench.serve` measures how long their answers take, one after another on one connection."""

import http.client
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Final
from urllib.parse import urlsplit

from .serve_flood import SCENE, SIZE

ROUNDS: Final = 50
GOAL_MS: Final = 10.0
HUGE: Final = "9" * 20_000
_WIDTH: Final = f"WIDTH={SIZE[0]}"
_LAYER: Final = f"layers={SCENE}"
REPLACED: Final = {
    "a huge width": (_WIDTH, "WIDTH=99999999999999999999"),
    "20,000 digits": (_WIDTH, f"WIDTH={HUGE}"),
    "a negative width": (_WIDTH, "WIDTH=-1"),
    "NaN": (",0,0,1,60,", ",0,0,1,nan,"),
    "infinity": (",0,0,1,60,", ",0,0,1,1e999,"),
    "full-width digits": (_WIDTH, "WIDTH=%EF%BC%96%EF%BC%94"),
    "an alias of a number": (_WIDTH, "WIDTH=0x40"),
    "one parameter twice": (_LAYER, f"{_LAYER}&LAYERS={SCENE}"),
    "20,000 layers": (_LAYER, "layers=" + "," * 20_000),
    "a path as a layer": (_LAYER, "layers=../../etc/passwd"),
}
"""Part of a good GetView → what replaces it."""


@dataclass(frozen=True)
class Refusal:
    """Time in which a hostile request gets its 400."""

    name: str
    p50_ms: float
    p99_ms: float


def measure_refusals(address: str, view: str) -> list[Refusal]:
    """Asks for each request ROUNDS times in turn. `view`: path of a good GetView."""
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=60)
    times_ms: dict[str, list[float]] = {name: [] for name in REPLACED}
    for number in range(ROUNDS + 1):
        for name, (old, new) in REPLACED.items():
            taken_ms = _time_refusal(connection, name, view.replace(old, new))
            if number > 0:  # the first round opens the service
                times_ms[name].append(taken_ms)
    connection.close()
    return [Refusal(name, statistics.median(times), statistics.quantiles(times, n=100)[98]) for name, times in times_ms.items()]


def _time_refusal(connection: http.client.HTTPConnection, name: str, path: str) -> float:
    start = time.perf_counter()
    connection.request("GET", path)
    response = connection.getresponse()
    response.read()
    taken_ms = (time.perf_counter() - start) * 1e3
    if response.status != 400:
        raise SystemExit(f"bench: {name}: got status {response.status}, expected 400")
    return taken_ms


def report_refusals(found: list[Refusal], report: Callable[[str], None]) -> list[dict[str, object]]:
    """Reports each kind of request; returns the rows."""
    for one in found:
        met = "met" if one.p99_ms <= GOAL_MS else "missed"
        report(f"400       {one.name:20} p50 {one.p50_ms:7.2f} ms   p99 {one.p99_ms:7.2f} ms   goal {GOAL_MS:.0f} ms: {met}")
    return [asdict(one) for one in found]
