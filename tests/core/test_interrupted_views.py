"""Ctrl-C ends the rendering of a view with KeyboardInterrupt and leaves nothing behind."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from .built import build_soup

PROGRAM = """
import os, signal, sys, threading, time

import numpy as np

from map3d import _core

# A shell ignores SIGINT in background processes, and their children inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)


def view(side):
    return _core.Camera("orthographic", (0, 0, 100), (1, 0, 0), (0, 1, 0), (0, 0, -1), (-60, 60, -60, 60), 0.0, 500.0, side, side)


def interrupt(scene):
    # The first chunk is opened while the view is traced.
    while scene.stats()["chunk_misses"] == 0:
        time.sleep(0.001)
    os.kill(os.getpid(), signal.SIGINT)


layers = [_core.LayerSpec("color", "png"), _core.LayerSpec("id", "png"), _core.LayerSpec("ao", "png", radius_m=40.0)]
scene = _core.Scene(sys.argv[1])
threading.Thread(target=interrupt, args=(scene,), daemon=True).start()
try:
    scene.render_view(view(4096), layers, threads=int(sys.argv[2]))
    print("not interrupted")
except KeyboardInterrupt:
    after, fresh = scene.render_view(view(128), layers), _core.Scene(sys.argv[1]).render_view(view(128), layers)
    same = all(np.array_equal(after[name], fresh[name]) for name in ("color", "id", "ao"))
    print("interrupted, then", "the same" if same and after["id"].any() else "another", "view")
    raise
"""


@pytest.mark.parametrize("threads", [1, 2])
def test_ctrl_c_ends_a_view(tmp_path: Path, threads: int) -> None:
    rng = np.random.default_rng(4)
    corners = rng.uniform((-60, -60, -20), (60, 60, 40), (300, 1, 3)) + rng.normal(0, 6, (300, 3, 3))
    build_soup(tmp_path, corners)
    done = subprocess.run([sys.executable, "-c", PROGRAM, str(tmp_path), str(threads)], capture_output=True, text=True, timeout=600, check=False)
    assert (done.stdout.strip(), done.returncode) == ("interrupted, then the same view", -signal.SIGINT), done.stderr
    assert "KeyboardInterrupt" in done.stderr
