"""Random SIGKILLs while a street changes from variant to variant: of importer, dispatcher, workers, Dask workers, their subprocesses and server."""

import random
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from map3d.catalogue import Workspace
from map3d.catalogue.mongodb_connection import CONNECT_S
from tests.catalogue.mongo_process import MongoProcess, build
from tests.faults.processes import MARK, Command, kill_child, survivors
from tests.faults.render_workers import DaskCluster, RenderWorkers, WorkProcess
from tests.faults.street import RENDERING, SCENE, VARIANTS, Expected, change_variant, make_workspace, read_result, render_undisturbed, street_file
from tests.faults.tile_reader import TileReader

DELAYS: Final = (0.01, 0.6)
"""Shortest and longest time between two kills, as shares of the time that an undisturbed `map3d render` takes on this machine now."""
IMPORT_KILLS: Final = 0.25
"""Share of the moments of an import at which a kill happens: an import is short, and most kills shall hit the render."""
MAX_SHOWN: Final = 4
"""Faults of a run that are printed."""
GIVE_UP_S: Final = 300.0
"""A run that takes longer has hung."""
QUARANTINE: Final = "in quarantine"
UNREACHABLE: Final = f"cannot reach the MongoDB server for {CONNECT_S:.0f} s"
WAYS: Final = {
    "sqlite": "catalogue in SQLite, map3d work",
    "mongodb": "catalogue in MongoDB, map3d work",
    "dask": "catalogue in SQLite, Dask workers",
}


@dataclass
class KillReport:
    """Counts of one run. `kills`: by victim; `retries`: failures that `_after_failure` allows, after which the command was started again."""

    seed: int
    kills: Counter[str] = field(default_factory=Counter)
    variants: list[int] = field(default_factory=list)
    retries: int = 0
    tiles_served: int = 0
    faults: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def __str__(self) -> str:
        counts = ", ".join(f"{count} {victim}" for victim, count in sorted(self.kills.items()))
        variants = "→".join(map(str, self.variants))
        outcome = "equal" if not self.faults else "FAULTS: " + "; ".join(self.faults[:MAX_SHOWN])
        retries = f", {self.retries} retries" if self.retries else ""
        return (
            f"seed {self.seed}: {self.kills.total()} kills ({counts}), variants {variants}{retries}, {self.tiles_served:,} tiles served, "
            f"{self.seconds:.0f} s: {outcome}"
        )


class Reference:
    """The undisturbed result of every variant, and a template of the workspace before its first render."""

    def __init__(self, folder: Path, houses: int) -> None:
        self.houses = houses
        self.template = folder / "template"
        make_workspace(self.template, houses)
        self._folder = folder
        self._expected: dict[int, Expected] = {}
        self.render_s = self._time_render()

    def _time_render(self) -> float:
        """Returns the time that an undisturbed `map3d render` takes, in seconds."""
        root = self._folder / "timed"
        shutil.copytree(self.template, root)
        render = Command("render", ["render", RENDERING, "--workers", "2", "-w", root])
        started = time.monotonic()
        render.start()
        assert render.wait(GIVE_UP_S) == 0, render.output()
        render.end()
        shutil.rmtree(root)
        return time.monotonic() - started

    def expected(self, variant: int) -> Expected:
        if variant not in self._expected:
            workspace = Workspace(self._folder / f"variant{variant}")
            shutil.copytree(self.template, workspace.root)
            change_variant(workspace, variant, self.houses)
            self._expected[variant] = render_undisturbed(workspace)
            shutil.rmtree(workspace.root)
        return self._expected[variant]

    def all_tiles(self) -> frozenset[str]:
        return frozenset().union(*(self.expected(variant).tiles for variant in range(VARIANTS)))


class KillRun:
    """One run: the same commands are started again after each kill until the last variant is complete."""

    def __init__(
        self, reference: Reference, workspace: Workspace, seed: int, kills: int, mongo: MongoProcess | None = None, is_dask: bool = False
    ) -> None:
        """`mongo`: the server of the workspace's catalogue, which is killed too; None for SQLite. `is_dask`: Dask workers render."""
        self._reference, self._kills, self._mongo = reference, kills, mongo
        self._choose = random.Random(seed)
        self._workspace, root = workspace, workspace.root
        environment = {"MAP3D_CATALOGUE": workspace.catalogue_url or "", MARK: str(root)}
        self._files = root / "files"
        self.report = KillReport(seed)
        where = ("-w", root)
        self._import = Command("import", ["add-files", SCENE, self._files / "street.obj", "--split", "group", *where], environment)
        self._workers: RenderWorkers = DaskCluster(root, environment) if is_dask else WorkProcess(RENDERING, root, environment)
        self._render = Command("dispatcher", ["render", RENDERING, *self._workers.render_options, *where], environment)
        self._serve = Command("server", ["serve", "--port", "0", *where], environment)
        self._retry = Command("retry", ["retry", RENDERING, *where], environment)

    def run(self) -> KillReport:
        reader = TileReader(self._serve, RENDERING, self._reference.all_tiles(), self._choose.randrange(1 << 30))
        started = time.monotonic()
        self._serve.start()
        try:
            reader.start()
            self._change(0)
            while self.report.kills.total() < self._kills:
                self._change(self._choose.randrange(VARIANTS))
            self._finish()
        finally:
            reader.stop()
            for process in (self._import, self._render, self._workers, self._serve, self._retry):
                process.end()
        self.report.faults += [f"still running: {command}" for command in survivors(str(self._workspace.root))]
        self.report.tiles_served = reader.tiles
        self.report.faults += reader.faults
        self.report.seconds = time.monotonic() - started
        return self.report

    def _change(self, variant: int) -> None:
        """Imports and renders a variant under kills."""
        street_file(self._files, variant, self._reference.houses)
        self.report.variants.append(variant)
        self._until_done(self._import)
        self._workers.start()
        self._until_done(self._render)
        self._workers.pause()

    def _until_done(self, command: Command) -> None:
        """Starts the command again after each kill until it succeeds."""
        command.start()
        deadline = time.monotonic() + GIVE_UP_S
        while time.monotonic() < deadline:
            self._pause(command)
            status = command.status()
            if status == 0:
                return
            if status is not None and status > 0:
                self._after_failure(command)
            if self.report.kills.total() < self._kills and status is None and (command is self._render or self._choose.random() < IMPORT_KILLS):
                self._kill(command)
            if command.status() is not None and command.status() != 0:
                command.start()
        raise TimeoutError(f"{command.name} has not ended after {GIVE_UP_S:.0f} s; its last output: {command.output()}")

    def _pause(self, command: Command) -> None:
        """Waits for a random time, or until the command has ended."""
        end = time.monotonic() + self._choose.uniform(*DELAYS) * self._reference.render_s
        while time.monotonic() < end and command.status() is None:
            time.sleep(0.005)

    def _after_failure(self, command: Command) -> None:
        """Allows three kinds of failure: an import whose parser was killed, jobs whose subprocess was killed three times, and a command that
        could not connect to the catalogue's server in time."""
        if command is self._render and QUARANTINE in command.output():
            self.report.retries += 1
            self._retry.start()
            self._retry.wait(60)
        elif self._mongo is not None and UNREACHABLE in command.output():
            self.report.retries += 1
        elif command is not self._import or "SIGKILL" not in command.output():
            raise RuntimeError(f"{command.name} failed with status {command.status()}: {command.output()}")

    def _kill(self, command: Command) -> None:
        victims = {"command": 30, "subprocess": 30, "worker": 15, "subprocess of worker": 15, "server": 10, "catalogue": 15 if self._mongo else 0}
        victim = self._choose.choices(list(victims), list(victims.values()))[0]
        if victim == "catalogue" and self._mongo is not None:
            self._mongo.kill()
            time.sleep(self._choose.uniform(0, 3))
            self._mongo.start()
            self.report.kills["catalogue"] += 1
        elif victim == "command":
            command.kill()
            self.report.kills[command.name] += 1
        elif victim == "subprocess" and kill_child(command.pid, self._choose):
            self.report.kills["subprocess"] += 1
        elif victim == "worker" and command is self._render:
            self.report.kills["worker"] += self._workers.kill_one(self._choose)
        elif victim == "subprocess of worker" and command is self._render:
            self.report.kills["subprocess"] += self._workers.kill_subprocess(self._choose)
        elif victim == "server":
            self._serve.kill()
            self._serve.start()
            self.report.kills["server"] += 1
        if command is self._render:
            self._workers.start()

    def _finish(self) -> None:
        """Compares the tiles with the undisturbed ones of the last variant, and runs `map3d verify`."""
        if read_result(self._workspace).digest != self._reference.expected(self.report.variants[-1]).digest:
            self.report.faults.append("tiles differ from the undisturbed ones")
        verify = Command("verify", ["verify", "-w", self._workspace.root], {"MAP3D_CATALOGUE": self._workspace.catalogue_url or ""})
        verify.start()
        if verify.wait(GIVE_UP_S):
            self.report.faults.append(f"verify: {verify.output()}")
        verify.end()


def run_kills(runs: int, kills: int, seed: int, houses: int = 48, way: str = "sqlite", show: bool = True) -> list[KillReport]:
    """Runs `kills` kills in each of `runs` runs; run number i has seed `seed + i`. `way`: one of WAYS."""
    reports = []
    with tempfile.TemporaryDirectory(prefix="map3d-faults-") as folder, _mongo(way, Path(folder)) as mongo:
        reference = Reference(Path(folder), houses)
        for number in range(runs):
            root = Path(folder) / f"run{number}"
            if mongo is None:
                shutil.copytree(reference.template, root)
                workspace = Workspace(root)
            else:
                workspace = make_workspace(root, houses, catalogue_url=f"{mongo.url}/run{number}")
            reports.append(KillRun(reference, workspace, seed + number, kills, mongo, is_dask=way == "dask").run())
            if show:
                print(reports[-1], flush=True)
            if not reports[-1].faults:
                shutil.rmtree(root)
    return reports


@contextmanager
def _mongo(way: str, folder: Path) -> Iterator[MongoProcess | None]:
    """Starts a MongoDB server for the way `mongodb`."""
    if way != "mongodb":
        yield None
        return
    build()
    (folder / "mongodb").mkdir()
    process = MongoProcess(folder / "mongodb").start()
    try:
        yield process
    finally:
        process.kill()
