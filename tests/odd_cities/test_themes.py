"""The theme with photographs is the default, wherever it is in the file."""

from pathlib import Path

import pytest

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import import_files
from map3d.ingest.import_options import ImportOptions
from tests.findings import warned
from tests.odd_cities.appearances import add_themes
from tests.odd_cities.towns import write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)


@pytest.mark.parametrize(("theme", "textures"), [(None, 1), ("photos", 1), ("use", 0)])
def test_the_theme_with_the_most_textures_is_drawn(tmp_path: Path, theme: str | None, textures: int) -> None:
    path = add_themes(write_citygml(tmp_path / "town.gml", None, lambda corners: corners))
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    (done,) = import_files(workspace, catalogue, "town", [path], ImportOptions(crs="local", theme=theme)).imported
    catalogue.close()
    assert len(list((workspace.asset_folder("town", "town") / "textures").glob("*"))) == textures
    used = [warning["example"] for warning in warned(done.report) if warning["code"] == "theme-used"]
    assert used == ([] if theme else ["photos"])
