"""A town under construction in a folder: which files are complete, and how a file is written whole or not at all."""

import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.synchronize import Event
from pathlib import Path

import numpy as np

from map3d_town.errors import TownError
from map3d_town.model import Plan
from map3d_town.plans import plan_town
from map3d_town.spec import TownSpec

VERSION = 2
JOURNAL = ".town.journal"
PART = ".part"


class Stopped(Exception):
    """The run was interrupted; what is complete stays."""


class Site:
    """The plan of a town and its folder. Workers get a copy, with `stop` set when they shall come to an end."""

    def __init__(self, out: Path, spec: TownSpec, done: dict[str, int], stop: Event | None = None) -> None:
        self.out, self.spec, self.done, self.stop = out, spec, done, stop
        self.plan, self.ground = plan_town(spec)
        self.shift = np.array([spec.east_m, spec.north_m, 0.0])
        self.made: dict[str, int] = {}
        self.kept: dict[str, int] = {}

    def missing(self, name: str) -> bool:
        """Whether a file must be written; a file is complete when it was noted so, with the size that it has."""
        path = self.out / name
        if name in self.done and path.is_file() and path.stat().st_size == self.done[name]:
            self.kept[name] = self.done[name]
            return False
        return True

    def check_going(self) -> None:
        """Raises Stopped once the run is interrupted; asked between buildings and windows."""
        if self.stop is not None and self.stop.is_set():
            raise Stopped

    def put(self, name: str, data: bytes) -> None:
        """Writes a file under another name and renames it, so that a file is there whole or not at all."""
        with self.place(name) as place:
            place.path.write_bytes(data)

    def place(self, name: str) -> "Place":
        return Place(self, name)

    def note(self, name: str, size: int) -> None:
        """Remembers a complete file, also if this process is killed next: one line, written at once, whichever process writes."""
        self.made[name] = size
        line = json.dumps([name, size]) + "\n"
        journal = os.open(self.out / JOURNAL, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        try:
            os.write(journal, line.encode())
        finally:
            os.close(journal)


class Place:
    """A file while it is written: `path` is renamed to its final name when all went well, removed otherwise."""

    def __init__(self, site: Site, name: str) -> None:
        self.site, self.name = site, name
        self.final = site.out / name
        self.path = self.final.with_name(f".{self.final.name}{PART}")

    def __enter__(self) -> "Place":
        self.final.parent.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(self, error: object, *_: object) -> None:
        if error is not None:
            self.path.unlink(missing_ok=True)
            return
        os.replace(self.path, self.final)
        self.site.note(self.name, self.final.stat().st_size)


def begun(out: Path, spec: TownSpec) -> dict[str, int]:
    """Name and size of the files that earlier runs completed; raises TownError when they were of another town."""
    path = out / "town.json"
    if not path.is_file():
        return {}
    record = json.loads(path.read_text())
    if record["spec"] != spec.record():
        raise TownError(f"{path}: this folder holds a town made with other arguments; use another folder or delete it")
    if record["version"] != VERSION:
        raise TownError(
            f"{path}: begun by another map3d (version {record['version']} of its towns, this one makes version {VERSION}); "
            "use another folder or delete it"
        )
    return dict(record["files"]) | _journal(out)


def _journal(out: Path) -> dict[str, int]:
    """What was noted since town.json was written last; a line cut short by a lost machine counts as none."""
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
def claimed(out: Path) -> Iterator[None]:
    """Held while a town is made, until the process ends; raises TownError when another one is at work here. Drafts of a killed run are removed."""
    out.mkdir(parents=True, exist_ok=True)
    with (out / JOURNAL).open("a") as journal:
        try:
            fcntl.flock(journal, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise TownError(f"{out}: another process makes this town now; wait for it, or use another folder") from error
        for draft in out.rglob(f".*{PART}"):
            draft.unlink()
        yield


def record(out: Path, spec: TownSpec, plan: Plan, files: dict[str, int]) -> None:
    """Writes town.json: the spec, what the town holds, the complete files with their sizes."""
    about = {"map3d": "town", "version": VERSION, "spec": spec.record(), "buildings": len(plan.lots), "trees": len(plan.trees)}
    text = json.dumps({**about, "extent_m": 2 * plan.radius_m, "files": dict(sorted(files.items()))}, indent=1, ensure_ascii=False)
    part = out / ".town.json.new"
    part.write_text(text + "\n")
    os.replace(part, out / "town.json")


def finish(out: Path, spec: TownSpec, plan: Plan, files: dict[str, int]) -> None:
    """The record of a complete town, which needs no journal."""
    record(out, spec, plan, files)
    (out / JOURNAL).unlink()
