"""The subprocess of a render worker starts quickly, and finds the keys that the plan has."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("map3d._core", reason="the compiled core is missing", exc_type=ImportError)

from map3d import _core
from map3d.catalogue import SceneRecord, Workspace
from map3d.geometry.core_frame import core_frame
from map3d.geometry.frames import pin
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import import_file
from map3d.ingest.sources import find_sources
from map3d.scenes.build import build, open_scene
from map3d.types import ViewAngles
from tests.cli.towns import house


def test_render_subprocess_starts_without_numpy() -> None:
    code = "import sys, map3d.renderings.block_renderer; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.fixture
def scene(tmp_path: Path) -> _core.Scene:
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town", options={"ground_plane": "off"}))
    path = tmp_path / "town.obj"
    path.write_text(house(0.0, 0.0, 9.0))
    import_file(workspace, catalogue, "town", find_sources([path])[0], ImportOptions())
    build(workspace, catalogue, "town", threads=1, max_memory_bytes=1 << 30)
    catalogue.close()
    return open_scene(workspace, "town")


def test_key_of_a_block_is_that_of_the_plan(scene: _core.Scene) -> None:
    frame = core_frame(pin(scene.box, 256, 0.1, [ViewAngles(30, 45)])[0].to_json())
    places = [(x, y) for x in range(4) for y in range(4)]
    planned = scene.block_keys(frame, 2, np.array(places, np.uint32))
    assert len(set(planned)) > 1
    assert [scene.block_key(frame, 2, x, y) for x, y in places] == planned
    with pytest.raises(_core.InvalidArgument, match="does not exist"):
        scene.block_key(frame, 2, 4, 0)
