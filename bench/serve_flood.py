"""Cached tiles while distinct views flood in, and hostile requests: `python -m bench.serve` measures them after the pairs with nginx.

`wrk` asks for perspective views of a generated town, no two alike, over more connections than the queue of views has places, while another `wrk` asks
for one cached tile. Both, the server and its tracers share this machine.
"""

import re
import signal
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

from map3d import _core
from map3d.catalogue import Workspace
from map3d.portrayal.tracer_pool import QUEUE, SUBPROCESSES

from .benchmark_scene import run_verb

SCENE: Final = "town"
BUILDINGS: Final = 60
CONNECTIONS: Final = QUEUE + SUBPROCESSES + 14
"""Connections that ask for views: some always find the queue full, and ask again at once."""
GOAL_MS: Final = 100.0
SIZE: Final = (640, 480)
START_S: Final = 5
"""Time in which the queue fills."""
SCRIPT: Final = """
local threads = {{}}
setup = function(thread) table.insert(threads, thread) end
init = function() asked, computed, refused, other = 0, 0, 0, 0 end
request = function()
  asked = asked + 1
  return wrk.format("GET", string.format("{path}", {x} + asked * 0.01))
end
response = function(status)
  if status == 200 then computed = computed + 1 elseif status == 503 then refused = refused + 1 else other = other + 1 end
end
done = function()
  for _, thread in ipairs(threads) do
    print(string.format("views: %d computed, %d refused, %d other", thread:get("computed"), thread:get("refused"), thread:get("other")))
  end
end
"""


@dataclass(frozen=True)
class FloodedTiles:
    """Requests a second and latency of tiles, without views and while they flood in. `refused`: views answered with 503; `other`: with neither an
    image nor 503."""

    alone_rate: float
    alone_p99_ms: float
    rate: float
    p50_ms: float
    p99_ms: float
    errors: int
    computed: int
    refused: int
    other: int


def add_town(workspace: Workspace, folder: Path) -> None:
    """Adds and builds the scene whose views are asked for."""
    where = ["-w", str(workspace.root)]
    run_verb(["make-town", "-o", str(folder), "--buildings", str(BUILDINGS), "--seed", "7", "--no-trees"])
    run_verb(["create-scene", SCENE, *where])
    run_verb(["add-files", SCENE, str(folder), *where])
    run_verb(["create-rendering", SCENE, SCENE, "--res", "1", "--view", "0/45", *where])
    run_verb(["estimate", SCENE, *where])


def town_view(workspace: Workspace) -> tuple[str, float]:
    """Returns the path of a GetView whose camera has %.2f as its first coordinate, and a value for it."""
    catalogue = workspace.open_catalogue()
    scene = catalogue.scene(SCENE)
    catalogue.close()
    assert scene.crs is not None, "the generated town has a CRS"
    assert scene.origin is not None, "the generated town has a CRS"
    low, high = _core.Scene(str(workspace.scene_folder(SCENE)), 1 << 20).box
    x, y, z = (origin + (one + other) / 2 for origin, one, other in zip(scene.origin, low, high, strict=True))
    camera = f"Perspective,%.2f,{y - 250:.2f},{z + 100:.2f},{x:.2f},{y:.2f},{z:.2f},0,0,1,60,,,"
    view = f"WIDTH={SIZE[0]};HEIGHT={SIZE[1]};PROJECTION={camera};IMAGELAYERS=COLOR;FORMATS=image/png"
    return f"/3dps?service=3DPS&version=1.0&request=GetView&crs=EPSG:{scene.crs.epsg}&layers={SCENE}&portrayals={view}", x


class Flood:
    """Asks for views while the context lasts, for at most `seconds`: from a point that moves by a centimetre each time. Afterwards, `computed`,
    `refused` and `other` are the numbers of answers."""

    def __init__(self, address: str, view: tuple[str, float], folder: Path, seconds: int) -> None:
        script = folder / "flood.lua"
        script.write_text(SCRIPT.format(path=view[0], x=f"{view[1]:.2f}"))
        self._command = ["wrk", "-t1", f"-c{CONNECTIONS}", f"-d{seconds}s", "--timeout", "60s", "-s", str(script), address]
        self.computed = self.refused = self.other = 0

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(self._command, stdout=subprocess.PIPE, text=True)
        return self

    def __exit__(self, *_: object) -> None:
        ended = self._process.poll() is not None
        self._process.send_signal(signal.SIGINT)
        text = self._process.communicate()[0]
        found = re.search(r"views: (\d+) computed, (\d+) refused, (\d+) other", text)
        assert found, text
        assert not ended, "the flood ended before the measurement"
        self.computed, self.refused, self.other = map(int, found.groups())


def report_flood(found: FloodedTiles, report: Callable[[str], None]) -> None:
    """Reports the latency. Exits if the flood was none: tiles are fast while nothing else is done."""
    if found.computed == 0 or found.refused == 0 or found.other > 0:
        raise SystemExit(f"bench: no flood: {found.computed} views computed, {found.refused} refused, {found.other} answered with other errors")
    report(f"flood     views  {found.computed:9,} computed   {found.refused:,} refused with 503")
    report(f"flood     tiles without views {found.alone_rate:9,.0f} requests/s   p99 {found.alone_p99_ms:7.2f} ms")
    met = "met" if found.p99_ms <= GOAL_MS and found.errors == 0 else "missed"
    latency = f"p50 {found.p50_ms:7.2f} ms   p99 {found.p99_ms:7.2f} ms"
    report(f"flood     tiles during views  {found.rate:9,.0f} requests/s   {latency}   goal {GOAL_MS:.0f} ms: {met}; {found.errors} errors")
