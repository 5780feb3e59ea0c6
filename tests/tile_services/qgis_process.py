"""QGIS without a window, in a process of its own with the Python that it was built for."""

import json
import os
import subprocess
from functools import lru_cache
from pathlib import Path

import pytest

PYTHON = "/usr/bin/python3"


@lru_cache
def qgis_version(folder: Path):
    """Returns None where QGIS is not installed."""
    command = [PYTHON, "-c", "import qgis.core; print(qgis.core.Qgis.QGIS_VERSION)"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment(folder))
    except OSError:
        return None
    return done.stdout.strip() or None


def environment(folder: Path):
    """QGIS leaves files in its home and among temporary files."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}
    return {**kept, "QT_QPA_PLATFORM": "offscreen", "LC_ALL": "C.UTF-8", "HOME": str(folder), "TMPDIR": str(folder)}


def qgis(folder: Path, **asked):
    """Returns what `qgis_script.py` saw; `out` in the result is the picture."""
    if qgis_version(folder) is None:
        pytest.skip("QGIS is not installed: apt install python3-qgis")
    out = folder / "qgis.png"
    command = [PYTHON, str(Path(__file__).with_name("qgis_script.py")), json.dumps({"size": [400, 300], "out": str(out), **asked})]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120, cwd=folder, env=environment(folder))
    line = next((line for line in done.stdout.splitlines() if line.startswith("RESULT")), None)
    assert line is not None, f"{done.stdout}\n{done.stderr}"
    return {**json.loads(line.removeprefix("RESULT")), "out": out}
