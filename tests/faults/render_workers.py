"""The processes that render beside the dispatcher's own workers: `map3d work`, or a Dask cluster on this machine."""

import random
import socket
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, Protocol

from tests.faults.processes import Command, kill_child

START_S: Final = 60.0


class RenderWorkers(Protocol):
    """Processes that faults hit. `render_options`: how `map3d render` uses them."""

    render_options: Sequence[str]

    def start(self) -> None:
        """Starts the processes that do not run."""

    def pause(self) -> None:
        """Ends what shall not run between two renders."""

    def kill_one(self, choose: random.Random) -> bool:
        """Kills one process, and starts it again; returns whether it ran."""

    def kill_subprocess(self, choose: random.Random) -> bool:
        """Kills one subprocess of one process; returns whether there was one."""

    def end(self) -> None: ...


class WorkProcess:
    """`map3d work` with one worker; the dispatcher has two more."""

    render_options: Final = ("--workers", "2")

    def __init__(self, rendering: str, root: Path, environment: Mapping[str, str]) -> None:
        self._command = Command("worker", ["work", rendering, "--workers", "1", "--forever", "-w", root], environment)

    def start(self) -> None:
        if not self._command.is_running():
            self._command.start()

    def pause(self) -> None:
        self._command.kill()

    def kill_one(self, choose: random.Random) -> bool:
        was_running = self._command.is_running()
        self._command.kill()
        self._command.start()
        return was_running

    def kill_subprocess(self, choose: random.Random) -> bool:
        return self._command.is_running() and kill_child(self._command.pid, choose)

    def end(self) -> None:
        self._command.end()


class DaskCluster:
    """A scheduler, which stays, and Dask workers of one thread; the dispatcher has no workers of its own."""

    def __init__(self, root: Path, environment: Mapping[str, str], workers: int = 2) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        address = f"tcp://127.0.0.1:{port}"
        self.render_options = ("--workers", "2", "--dask", address)
        environment = {**environment, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
        scheduler = ["--host", "127.0.0.1", "--port", port, "--dashboard-address", "127.0.0.1:0"]
        self._scheduler = Command("Dask scheduler", scheduler, environment, module="distributed.cli.dask_scheduler")
        worker = [address, "--host", "127.0.0.1", "--nthreads", 1, "--no-nanny", "--no-dashboard", "--local-directory", root / "dask"]
        self._workers = [Command("Dask worker", worker, environment, module="distributed.cli.dask_worker") for _ in range(workers)]
        self._port = port

    def start(self) -> None:
        if not self._scheduler.is_running():
            self._scheduler.start()
            self._wait_for_scheduler()
        for worker in self._workers:
            if not worker.is_running():
                worker.start()

    def pause(self) -> None:
        """Does nothing: a cluster outlives the renders on it."""

    def kill_one(self, choose: random.Random) -> bool:
        worker = choose.choice(self._workers)
        was_running = worker.is_running()
        worker.kill()
        worker.start()
        return was_running

    def kill_subprocess(self, choose: random.Random) -> bool:
        worker = choose.choice(self._workers)
        return worker.is_running() and kill_child(worker.pid, choose)

    def end(self) -> None:
        for command in (*self._workers, self._scheduler):
            command.end()

    def _wait_for_scheduler(self) -> None:
        deadline = time.monotonic() + START_S
        while time.monotonic() < deadline:
            try:
                socket.create_connection(("127.0.0.1", self._port), timeout=1).close()
            except OSError:
                time.sleep(0.05)
            else:
                return
        raise TimeoutError(f"the Dask scheduler does not listen: {self._scheduler.output()}")
