"""Speed of reading, import and build: CityGML in MB, textures of 1024², triangles, per CPU second of one core."""

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
from map3d.ingest.sources import SourceDocument, find_sources

from .benchmark_scene import CACHE, run_verb

ORIGIN_STEP_M = 100.0


@dataclass(frozen=True)
class IngestRow:
    """An amount in `unit`, processed in `cpu_s` CPU seconds."""

    what: str
    amount: float
    unit: str
    cpu_s: float

    @property
    def rate(self) -> float:
        return self.amount / self.cpu_s


def measure(documents: list[Path] | None = None, buildings: int = 100) -> list[dict[str, Any]]:
    """Measures reading, import and build of each document, by default a town, and prints the table."""
    rows = [row for path in documents or [_create_town(buildings)] for row in measure_document(path)]
    table = Table(title="import, one core", title_justify="left")
    for column in ("", "amount", "CPU s", "rate"):
        table.add_column(column, justify="left" if not column else "right")
    for row in rows:
        table.add_row(row.what, f"{row.amount:,.1f} {row.unit}", f"{row.cpu_s:.2f}", f"{row.rate:,.1f} {row.unit}/s")
    Console().print(table)
    return [{**asdict(row), "rate": row.rate} for row in rows]


def measure_document(path: Path) -> list[IngestRow]:
    (source,) = find_sources([path])
    scene = CACHE / "ingest"
    shutil.rmtree(scene, ignore_errors=True)
    asset = scene / "assets" / source.name
    asset.mkdir(parents=True)
    size = path.stat().st_size / 1e6
    request = _parser_request(source, asset)
    reader = json.dumps(request["reader"])
    read_s, _ = time_cpu(lambda: sum(batch.triangle_count for batch in _core.Reader(str(path), source.format, reader)))
    import_s, _ = time_cpu(lambda: open_document_parser({})(request, [], lambda _progress: None))
    rows = [IngestRow(f"{path.name}: read", size, "MB", read_s), IngestRow(f"{path.name}: import", size, "MB", import_s)]
    try:
        return rows + _measure_build(path.name, scene, source)
    finally:
        shutil.rmtree(scene)


def _measure_build(name: str, scene: Path, source: SourceDocument) -> list[IngestRow]:
    """Measures the CPU time between the stages that the build reports."""
    asset = scene / "assets" / source.name
    count = sum(1 for _ in (asset / "objects.jsonl").open())
    (asset / "ids.u32").write_bytes(b"".join((number + 1).to_bytes(4, "little") for number in range(count)))
    request = {"assets": [source.name], "origin": _scene_origin(asset), "ground_id": count + 1, "threads": 1}
    seen: dict[str, float] = {}

    def progress(stage: str, _done: int, _total: int) -> bool:
        seen.setdefault(stage, time.process_time())
        return True

    begun = time.process_time()
    report = json.loads(_core.build_scene(str(scene), json.dumps(request), progress))
    ended = time.process_time()
    rows = [IngestRow(f"{name}: chunks", report["triangles"] / 1e6, "M triangles", ended - seen["chunks"])]
    if report["textures"]:
        rows.insert(0, IngestRow(f"{name}: textures", report["textures"], "images", seen["measure"] - begun))
    return rows


def _parser_request(source: SourceDocument, folder: Path) -> dict[str, Any]:
    options = ImportOptions(crs="local")
    limits = options.limits(source.paths, source.format)
    place = {"path": str(source.paths[0].absolute()), "format": source.format, "folder": str(folder.absolute()), "name": source.name}
    return {**place, "reader": options.reader_options(source.format, limits), "crs": "local", "scene_crs": "local", "placing": {}, "place": None}


def _scene_origin(asset: Path) -> list[float]:
    low, high = json.loads((asset / "report.json").read_text())["box_source"]
    middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]]
    return [round(value / ORIGIN_STEP_M) * ORIGIN_STEP_M for value in middle]


def _create_town(buildings: int) -> Path:
    folder = CACHE / f"ingest-town-{buildings}"
    if not folder.exists():
        run_verb(["make-town", "-o", str(folder), "--buildings", str(buildings), "--texture-px", "1024", "--no-terrain", "--no-trees"])
    return next(folder.glob("citygml/buildings_*.gml"))


def time_cpu(work: Callable[[], Any]) -> tuple[float, Any]:
    """Returns the CPU seconds of a call and its result."""
    begun = time.process_time()
    result = work()
    return time.process_time() - begun, result


if __name__ == "__main__":
    measure()
