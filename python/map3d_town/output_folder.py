"""The folder of a town under construction: its journal of complete files, and atomic writes."""

import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import numpy as np

from map3d_town.layout.plan_town import plan_town
from map3d_town.layout.town_plan import TownPlan
from map3d_town.town_errors import TownError
from map3d_town.town_spec import TownSpec

VERSION = 3
JOURNAL = ".town.journal"
PART = ".part"


class ProductionInterrupted(Exception):
    """The run was interrupted; complete files stay."""


class TownFolder:
    """A town's plan and output folder. Workers get a copy without the plan, of which each job brings its part; `stop` asks them to end.

    `completed`: name and size of the files of earlier runs. `written`, `kept`: those that the current job wrote, or found complete.
    """

    def __init__(self, root: Path, spec: TownSpec, completed: dict[str, int], stop: Event | None = None) -> None:
        self.root, self.spec, self.completed, self.stop = root, spec, completed, stop
        self.plan, self.ground = plan_town(spec)
        self.crs_offset = np.array([spec.east_m, spec.north_m, 0.0])
        self.written: dict[str, int] = {}
        self.kept: dict[str, int] = {}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "plan": TownPlan(radius_m=self.plan.radius_m)}

    def needs(self, name: str) -> bool:
        """Returns whether a file must be written; otherwise adds it to `kept`. A complete file is in the journal with its current size."""
        path = self.root / name
        if name in self.completed and path.is_file() and path.stat().st_size == self.completed[name]:
            self.kept[name] = self.completed[name]
            return False
        return True

    def raise_if_interrupted(self) -> None:
        """Raises ProductionInterrupted after an interrupt; called between buildings and orthophoto windows."""
        if self.stop is not None and self.stop.is_set():
            raise ProductionInterrupted

    def write(self, name: str, data: bytes) -> None:
        """Writes a file atomically."""
        with self.open_pending(name) as pending:
            pending.path.write_bytes(data)

    def open_pending(self, name: str) -> "PendingFile":
        return PendingFile(self, name)

    def add_to_journal(self, name: str, size: int) -> None:
        """Records a complete file: one line in one write, so it survives a kill, whichever process writes."""
        self.written[name] = size
        line = json.dumps([name, size]) + "\n"
        journal = os.open(self.root / JOURNAL, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        try:
            os.write(journal, line.encode())
        finally:
            os.close(journal)


class PendingFile:
    """A file being written to `path`: on success it is renamed and recorded, on failure removed."""

    def __init__(self, town: TownFolder, name: str) -> None:
        self.town, self.name = town, name
        self.final = town.root / name
        self.path = self.final.with_name(f".{self.final.name}{PART}")

    def __enter__(self) -> "PendingFile":
        self.final.parent.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(self, error: object, *_: object) -> None:
        if error is not None:
            self.path.unlink(missing_ok=True)
            return
        os.replace(self.path, self.final)
        self.town.add_to_journal(self.name, self.final.stat().st_size)


def read_completed_files(out: Path, spec: TownSpec) -> dict[str, int]:
    """Returns name and size of the files that earlier runs completed. Raises TownError if the folder holds a town of another spec or version."""
    path = out / "town.json"
    if not path.is_file():
        return {}
    record = json.loads(path.read_text())
    if record["spec"] != spec.to_json():
        raise TownError(f"{path}: the folder holds a town with other options; use another folder or delete this one")
    if record["version"] != VERSION:
        raise TownError(f"{path}: the town has version {record['version']}, expected version {VERSION}; use another folder or delete this one")
    return dict(record["files"]) | _read_journal(out)


def _read_journal(out: Path) -> dict[str, int]:
    """Returns the files recorded since town.json was last written. Ignores incomplete lines."""
    path, found = out / JOURNAL, {}
    for line in path.read_bytes().splitlines(keepends=True) if path.is_file() else ():
        try:
            name, size = json.loads(line)
        except ValueError:
            continue
        if line.endswith(b"\n"):
            found[str(name)] = int(size)
    return found


@contextmanager
def lock_folder(out: Path) -> Iterator[None]:
    """Locks the folder and removes partial files of killed runs. Raises TownError if another process has locked it."""
    out.mkdir(parents=True, exist_ok=True)
    with (out / JOURNAL).open("a") as journal:
        try:
            fcntl.flock(journal, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise TownError(f"{out}: another process is generating this town; wait until it ends, or use another folder") from error
        for partial in out.rglob(f".*{PART}"):
            partial.unlink()
        yield


def write_town_json(out: Path, spec: TownSpec, plan: TownPlan, files: dict[str, int]) -> None:
    """Writes town.json: the spec, counts, and complete files with their sizes."""
    about = {"map3d": "town", "version": VERSION, "spec": spec.to_json(), "buildings": len(plan.buildings), "trees": len(plan.trees)}
    text = json.dumps({**about, "extent_m": 2 * plan.radius_m, "files": dict(sorted(files.items()))}, indent=1, ensure_ascii=False)
    part = out / ".town.json.new"
    part.write_text(text + "\n")
    os.replace(part, out / "town.json")


def finish_town(out: Path, spec: TownSpec, plan: TownPlan, files: dict[str, int]) -> None:
    """Writes town.json for the complete town and removes the journal."""
    write_town_json(out, spec, plan, files)
    (out / JOURNAL).unlink()
