"""What a change of one building costs, start-up included, against rendering all: a building is raised, added, removed; nothing is changed."""

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

from .scene import CACHE

MAP3D = (sys.executable, "-c", "from map3d.cli.app import main; main()")
POINTS = re.compile(r"(<gml:posList[^>]*>)([^<]*)(</gml:posList>)")


@dataclass(frozen=True)
class Row:
    """Seconds of wall time and of processors, children included; `blocks` that were rendered; `share` of the processor time of rendering all."""

    what: str
    wall_s: float
    cpu_s: float
    blocks: int
    share: float


def measure(buildings: int = 1000, files: int = 20, levels: int = 8) -> list[dict[str, Any]]:
    """Rows for a town over several files, seen from one side; the table is printed."""
    bench = _Bench(CACHE / f"changes-{buildings}-{files}-{levels}", buildings, files, levels)
    rows = [bench.whole(), *(bench.change(how) for how in ("raised", "added", "removed")), bench.render("nothing changed")]
    table = Table(title=f"one of {buildings:,} buildings in {files} files, {levels} levels", title_justify="left")
    for column in ("", "wall s", "processor s", "blocks", "of all"):
        table.add_column(column, justify="left" if not column else "right")
    for row in rows:
        table.add_row(row.what, f"{row.wall_s:.2f}", f"{row.cpu_s:.2f}", str(row.blocks), f"{100 * row.share:.2f} %")
    Console().print(table)
    return [asdict(row) for row in rows]


class _Bench:
    def __init__(self, folder: Path, buildings: int, files: int, levels: int) -> None:
        self.town, self.workspace = folder / "town", Workspace(folder / "workspace")
        self._spec, self._levels = (buildings, files), levels
        self._all_s = 0.0

    def whole(self) -> Row:
        """All of it, made anew, but for making the town."""
        if not self.town.exists():
            buildings, files = (str(number) for number in self._spec)
            self._run("make-town", "-o", str(self.town), "--buildings", buildings, "--files", files, "--texture-px", "256", where=False)
        self._document = sorted(self.town.glob("citygml/buildings_*.gml"))[-1]
        self._text = self._document.read_text(encoding="utf-8")
        if self.workspace.root.exists():
            raise SystemExit(f"bench: {self.workspace.root} is there already; remove it to measure again")
        spent = [self._run("create-scene", "town"), self._run("add-files", "town", str(self.town))]
        spent.append(self._run("create-rendering", "town", "view", "--levels", str(self._levels), "--view", "0/45"))
        row = self.render("all")
        self._all_s = row.cpu_s + sum(cpu for _, cpu, _ in spent)
        return Row("all", row.wall_s + sum(wall for wall, _, _ in spent), self._all_s, row.blocks, 1.0)

    def change(self, how: str) -> Row:
        """The file is put back afterwards, but not the scene: each change starts from the one before."""
        self._document.write_text(changed(self._text, how), encoding="utf-8")
        try:
            wall, cpu, _ = self._run("add-files", "town", str(self._document))
        finally:
            self._document.write_text(self._text, encoding="utf-8")
        row = self.render(how)
        return Row(how, wall + row.wall_s, cpu + row.cpu_s, row.blocks, (cpu + row.cpu_s) / self._all_s)

    def render(self, what: str) -> Row:
        wall, cpu, out = self._run("render", "view", "--json")
        return Row(what, wall, cpu, int(json.loads(out)["statistics"]["done"]), cpu / self._all_s if self._all_s else 1.0)

    def _run(self, *words: str, where: bool = True) -> tuple[float, float, str]:
        place = ["-w", str(self.workspace.root)] if where else []
        begun, before = time.perf_counter(), _children_s()
        done = subprocess.run([*MAP3D, *words, *place], stdout=subprocess.PIPE, text=True, check=False, env={**os.environ})
        if done.returncode != 0:
            raise SystemExit(f"bench: map3d {' '.join(words)} failed")
        return time.perf_counter() - begun, _children_s() - before, done.stdout


def changed(text: str, how: str) -> str:
    """A CityGML document with its second building raised by 1.25 m, removed, or there once more, raised."""
    name = re.findall(r'<bldg:Building gml:id="([^"]+)"', text)[1]
    start = text.index(f'<core:cityObjectMember><bldg:Building gml:id="{name}"')
    end = text.index("</core:cityObjectMember>", start) + len("</core:cityObjectMember>")
    building = text[start:end]
    raised = POINTS.sub(lambda found: found[1] + _raised(found[2]) + found[3], building)
    new = {"raised": raised, "removed": "", "added": building + raised.replace(name, f"{name}_more")}[how]
    return text[:start] + new + text[end:]


def _raised(points: str) -> str:
    numbers = points.split()
    numbers[2::3] = [f"{float(height) + 1.25:.3f}" for height in numbers[2::3]]
    return " ".join(numbers)


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    measure()
