"""A format is a folder and a row: the made-up one of tests/formats/made_up is imported and built by every front."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.scenes.build import BUILD_BYTES, build

MADE_UP = Path(__file__).parent / "made_up"
ROOT = Path(__file__).parents[2]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "city"
    made.mkdir()
    (made / "houses.boxes").write_text("boxes\na 0 0 0 8 6 5\nb 20 0 0 8 6 9\n")
    (made / "broken.boxes").write_text("no boxes\n")
    (made / "houses.colours").write_text("a red\n")
    return made


@pytest.mark.parametrize(
    ("front", "shown"),
    [("cli", ["boxes (.boxes)", "objects      2: 2 box"]), ("rest", ['"format":"boxes"']), ("studio", ["Boxes · 2 objects", "GeoTIFF, Boxes"])],
)
def test_a_made_up_format_is_imported_and_built(tmp_path: Path, folder: Path, front: str, shown: list[str]) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(MADE_UP), str(ROOT)])}
    command = [sys.executable, str(MADE_UP / "fronts.py"), front, str(tmp_path / "workspace"), str(folder)]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True)
    result = json.loads(done.stdout.splitlines()[-1])
    (asset,) = result["assets"]
    assert (asset["name"], asset["format"]) == ("houses", "boxes")
    report = asset["report"]
    assert (report["objects"], report["triangles"], report["inputs"]["reader"]) == (2, 24, 7)
    assert report["inputs"]["options"]["transparency"] == "auto"
    for text in shown:
        assert text in result["shown"].replace('": "', '":"'), result["shown"]
    said = result["shown"] + " ".join(result["log"])
    assert "broken.boxes" in said, "a broken file is reported"
    assert "houses.colours" in said, "a companion is said to be used"
    workspace = Workspace(tmp_path / "workspace")
    catalogue = workspace.open_catalogue()
    build(workspace, catalogue, "town", threads=1, max_memory_bytes=BUILD_BYTES)
    catalogue.close()
    assert list(workspace.scene_folder("town").rglob("*.m3c"))
