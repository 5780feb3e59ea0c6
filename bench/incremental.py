"""The cost of a change of one building, raised, added, removed or none, compared with rendering everything; includes start-up."""

import json
import os
import re
import resource
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from map3d.catalogue import Workspace

from .benchmark_scene import CACHE

MAP3D = (sys.executable, "-c", "from map3d.cli.app import main; main()")
POINTS = re.compile(r"(<gml:posList[^>]*>)([^<]*)(</gml:posList>)")


@dataclass(frozen=True)
class ChangeRow:
    """Wall and CPU seconds, children included; `blocks`: number of rendered blocks; `share`: of the CPU time for everything."""

    what: str
    wall_s: float
    cpu_s: float
    blocks: int
    share: float


def measure(buildings: int = 1000, files: int = 20, levels: int = 8) -> list[dict[str, Any]]:
    """Measures a town in several files, rendered in one view, and prints the table."""
    bench = IncrementalBenchmark(CACHE / f"changes-{buildings}-{files}-{levels}", buildings, files, levels)
    rows = [bench.measure_all(), *(bench.measure_change(how) for how in ("raised", "added", "removed")), bench.measure_render("nothing changed")]
    table = Table(title=f"one of {buildings:,} buildings in {files} files, {levels} levels", title_justify="left")
    for column in ("", "wall s", "CPU s", "blocks", "of all"):
        table.add_column(column, justify="left" if not column else "right")
    for row in rows:
        table.add_row(row.what, f"{row.wall_s:.2f}", f"{row.cpu_s:.2f}", str(row.blocks), f"{100 * row.share:.2f} %")
    Console().print(table)
    return [asdict(row) for row in rows]


class IncrementalBenchmark:
    def __init__(self, folder: Path, buildings: int, files: int, levels: int) -> None:
        self.town, self.workspace = folder / "town", Workspace(folder / "workspace")
        self._spec, self._levels = (buildings, files), levels
        self._all_s = 0.0

    def measure_all(self) -> ChangeRow:
        """Measures import and rendering from scratch; generating the town does not count."""
        if not self.town.exists():
            buildings, files = (str(number) for number in self._spec)
            self._run("make-town", "-o", str(self.town), "--buildings", buildings, "--files", files, "--texture-px", "256", where=False)
        self._document = sorted(self.town.glob("citygml/buildings_*.gml"))[-1]
        self._text = self._document.read_text(encoding="utf-8")
        if self.workspace.root.exists():
            raise SystemExit(f"bench: {self.workspace.root} already exists; delete it to measure again")
        spent = [self._run("create-scene", "town"), self._run("add-files", "town", str(self.town))]
        spent.append(self._run("create-rendering", "town", "view", "--levels", str(self._levels), "--view", "0/45"))
        row = self.measure_render("all")
        self._all_s = row.cpu_s + sum(cpu for _, cpu, _ in spent)
        return ChangeRow("all", row.wall_s + sum(wall for wall, _, _ in spent), self._all_s, row.blocks, 1.0)

    def measure_change(self, how: str) -> ChangeRow:
        """Measures a change. Restores the file afterwards but not the scene, so each change starts from the previous one."""
        self._document.write_text(change_document(self._text, how), encoding="utf-8")
        try:
            wall, cpu, _ = self._run("add-files", "town", str(self._document))
        finally:
            self._document.write_text(self._text, encoding="utf-8")
        row = self.measure_render(how)
        return ChangeRow(how, wall + row.wall_s, cpu + row.cpu_s, row.blocks, (cpu + row.cpu_s) / self._all_s)

    def measure_render(self, what: str) -> ChangeRow:
        wall, cpu, out = self._run("render", "view", "--json")
        return ChangeRow(what, wall, cpu, int(json.loads(out)["statistics"]["done"]), cpu / self._all_s if self._all_s else 1.0)

    def _run(self, *words: str, where: bool = True) -> tuple[float, float, str]:
        place = ["-w", str(self.workspace.root)] if where else []
        begun, before = time.perf_counter(), _children_s()
        done = subprocess.run([*MAP3D, *words, *place], stdout=subprocess.PIPE, text=True, check=False, env={**os.environ})
        if done.returncode != 0:
            raise SystemExit(f"bench: map3d {' '.join(words)} failed")
        return time.perf_counter() - begun, _children_s() - before, done.stdout


def change_document(text: str, how: str) -> str:
    """Returns a CityGML document with its second building raised by 1.25 m, removed, or with a raised copy of it added."""
    name = re.findall(r'<bldg:Building gml:id="([^"]+)"', text)[1]
    start = text.index(f'<core:cityObjectMember><bldg:Building gml:id="{name}"')
    end = text.index("</core:cityObjectMember>", start) + len("</core:cityObjectMember>")
    building = text[start:end]
    raised = POINTS.sub(lambda found: found[1] + _raise_points(found[2]) + found[3], building)
    new = {"raised": raised, "removed": "", "added": building + raised.replace(name, f"{name}_more")}[how]
    return text[:start] + new + text[end:]


def _raise_points(points: str) -> str:
    numbers = points.split()
    numbers[2::3] = [f"{float(height) + 1.25:.3f}" for height in numbers[2::3]]
    return " ".join(numbers)


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    measure()
