"""Runs scripts in Chromium and the command line as a separate process."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PLAYWRIGHT = ROOT / "viewer" / "node_modules" / "playwright-core"
CHROMIUM = Path(os.environ.get("CHROMIUM", "/usr/bin/chromium"))
SCRIPT_S = 120


def browse(script: str, *, limit_s: float = SCRIPT_S, **asked: Any) -> dict[str, Any]:
    """Runs a script of this folder and returns its result."""
    if not CHROMIUM.exists() and not os.environ.get("MAP3D_REQUIRE_BROWSERS"):
        pytest.skip(f"{CHROMIUM} is not installed; apt install chromium, or set CHROMIUM")
    node = shutil.which("node")
    assert node, "Node.js is missing"
    assert PLAYWRIGHT.is_dir(), "playwright-core is missing; run make .cache/npm"
    command = [node, str(Path(__file__).with_name(script)), str(PLAYWRIGHT), json.dumps(asked)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=limit_s, check=False)
    if done.returncode:
        pytest.fail(f"{script} failed:\n{done.stderr[-2000:]}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def picture(name: str) -> str:
    """Returns the path for a screenshot."""
    folder = ROOT / "tests" / ".out"
    folder.mkdir(exist_ok=True)
    return str(folder / name)


def command(*arguments: str | Path) -> list[str]:
    """Returns the arguments that run the command line as a separate process."""
    return [sys.executable, "-m", "map3d", *map(str, arguments)]


@contextmanager
def served(workspace: Path, *options: str) -> Iterator[str]:
    """Yields the address of `map3d serve`."""
    server = subprocess.Popen(
        command("serve", "-w", workspace, "--port", "0", *options), stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}
    )
    assert server.stdout is not None
    try:
        for line in server.stdout:
            if found := re.search(r"http://[^\s/]+", line):
                yield found[0]
                break
        else:
            pytest.fail("the server exited without printing an address")
    finally:
        server.terminate()
        server.wait(20)
        server.stdout.close()
