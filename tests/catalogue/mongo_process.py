"""A server process on the loopback interface that speaks MongoDB's wire protocol: mongo-java-server, with its data in a file.

It stands for MongoDB in the tests. It is atomic and survives a restart, but has no transactions and no secondary indexes; nothing about the speed or
the concurrency of a real server follows from it. MAP3D_TEST_MONGODB names the URL of a real server to use instead, without a database.
"""

import os
import select
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
BUILT = ROOT / ".cache" / "mongo-server"
START_S, BUILD_S = 60.0, 300.0


class Unavailable(Exception):
    """The server cannot be had on this machine; the message says why."""


class MongoProcess:
    """A server with its data in `folder`. After `kill` or `stop`, `start` serves the same data on the same port."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, 0
        self._process: subprocess.Popen[str] | None = None

    @property
    def url(self) -> str:
        return f"mongodb://127.0.0.1:{self.port}"

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    def start(self) -> "MongoProcess":
        """Returns when the server accepts connections."""
        classes = f"{BUILT}:{BUILT}/jars/*"
        command = ["java", "-Xmx512m", "-XX:+UseSerialGC", "-cp", classes, "MongoServerMain", str(self.folder / "data.mv"), str(self.port)]
        errors = (self.folder / "errors.txt").open("w")
        with errors:
            self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True)
        stdout = self._process.stdout
        assert stdout is not None
        ready, _, _ = select.select([stdout], [], [], START_S)
        line = stdout.readline() if ready else ""
        if not line.strip().isdecimal():
            self.kill()
            raise Unavailable(f"the test server of MongoDB did not start: {(self.folder / 'errors.txt').read_text()[-500:]}")
        self.port = int(line)
        return self

    def stop(self) -> None:
        """Ends the server, which writes all data first."""
        self._end(kill=False)

    def kill(self) -> None:
        self._end(kill=True)

    def _end(self, kill: bool) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        process.kill() if kill else process.terminate()
        process.wait(START_S)
        if process.stdout is not None:
            process.stdout.close()


def build() -> None:
    """Fetches and compiles the server once; raises Unavailable."""
    if shutil.which("java") is None or shutil.which("make") is None:
        raise Unavailable("java or make is not installed: apt install default-jdk-headless maven make")
    try:
        made = subprocess.run(["make", "-s", "mongo-server"], cwd=ROOT, capture_output=True, text=True, timeout=BUILD_S, check=False)
    except subprocess.TimeoutExpired:
        raise Unavailable(f"make mongo-server took more than {BUILD_S:.0f} s") from None
    if not (BUILT / "MongoServerMain.class").is_file():
        raise Unavailable(f"make mongo-server failed: {(made.stdout + made.stderr)[-500:]}")


def real_server() -> str | None:
    return os.environ.get("MAP3D_TEST_MONGODB")
