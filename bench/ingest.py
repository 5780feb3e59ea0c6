"""How fast documents and images come in: CityGML in MB a second, textures of 1024² a second, trees of triangles; processor time of one core."""

import json
import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from map3d import _core
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.parse_document import open_document_parser
from map3d.ingest.sources import Source, find_sources

from .scene import CACHE, _do

ORIGIN_STEP_M = 100.0


@dataclass(frozen=True)
class Row:
    """`amount` in `unit`, done in `cpu_s` seconds."""

    what: str
    amount: float
    unit: str
    cpu_s: float

    @property
    def rate(self) -> float:
        return self.amount / self.cpu_s


def measure(documents: list[Path] | None = None, buildings: int = 100) -> list[dict[str, Any]]:
    """Rows for each document (a town's unless given): reading, import as an asset, build of textures and chunks. The table is printed."""
    rows = [row for path in documents or [_town(buildings)] for row in of_document(path)]
    table = Table(title="coming in, one core", title_justify="left")
    for column in ("", "amount", "processor s", "rate"):
        table.add_column(column, justify="left" if not column else "right")
    for row in rows:
        table.add_row(row.what, f"{row.amount:,.1f} {row.unit}", f"{row.cpu_s:.2f}", f"{row.rate:,.1f} {row.unit}/s")
    Console().print(table)
    return [{**asdict(row), "rate": row.rate} for row in rows]


def of_document(path: Path) -> list[Row]:
    (source,) = find_sources([path])
    scene = CACHE / "ingest"
    shutil.rmtree(scene, ignore_errors=True)
    asset = scene / "assets" / source.name
    asset.mkdir(parents=True)
    size = path.stat().st_size / 1e6
    question = _question(source, asset)
    reader = json.dumps(question["reader"])
    read_s, _ = spent(lambda: sum(batch.triangle_count for batch in _core.Reader(str(path), source.format, reader)))
    import_s, _ = spent(lambda: open_document_parser({})(question, [], lambda _told: None))
    rows = [Row(f"{path.name}: read", size, "MB", read_s), Row(f"{path.name}: import", size, "MB", import_s)]
    try:
        return rows + _built(path.name, scene, source)
    finally:
        shutil.rmtree(scene)


def _built(name: str, scene: Path, source: Source) -> list[Row]:
    """Processor time between the stages that the build tells."""
    asset = scene / "assets" / source.name
    count = sum(1 for _ in (asset / "objects.jsonl").open())
    (asset / "ids.u32").write_bytes(b"".join((number + 1).to_bytes(4, "little") for number in range(count)))
    request = {"assets": [source.name], "origin": _origin(asset), "ground_id": count + 1, "threads": 1}
    seen: dict[str, float] = {}

    def progress(stage: str, _done: int, _total: int) -> bool:
        seen.setdefault(stage, time.process_time())
        return True

    begun = time.process_time()
    report = json.loads(_core.build_scene(str(scene), json.dumps(request), progress))
    ended = time.process_time()
    rows = [Row(f"{name}: chunks", report["triangles"] / 1e6, "M triangles", ended - seen["chunks"])]
    if report["textures"]:
        rows.insert(0, Row(f"{name}: textures", report["textures"], "images", seen["measure"] - begun))
    return rows


def _question(source: Source, folder: Path) -> dict[str, Any]:
    options = ImportOptions(crs="local")
    limits = options.limits(source.paths, source.format)
    place = {"path": str(source.paths[0].absolute()), "format": source.format, "folder": str(folder.absolute()), "name": source.name}
    return {**place, "reader": options.reader_options(source.format, limits), "crs": "local", "scene_crs": "local"}


def _origin(asset: Path) -> list[float]:
    low, high = json.loads((asset / "report.json").read_text())["box_source"]
    middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]]
    return [round(value / ORIGIN_STEP_M) * ORIGIN_STEP_M for value in middle]


def _town(buildings: int) -> Path:
    folder = CACHE / f"ingest-town-{buildings}"
    if not folder.exists():
        _do(["make-town", "-o", str(folder), "--buildings", str(buildings), "--texture-px", "1024", "--no-terrain", "--no-trees"])
    return next(folder.glob("citygml/buildings_*.gml"))


def spent(work: Callable[[], Any]) -> tuple[float, Any]:
    """Processor seconds of this process, and the result."""
    begun = time.process_time()
    result = work()
    return time.process_time() - begun, result


if __name__ == "__main__":
    measure()
