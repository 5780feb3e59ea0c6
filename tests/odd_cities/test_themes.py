"""The theme with photographs is the default, wherever it is in the file."""

from pathlib import Path

import pytest
from PIL import Image

from map3d.catalogue import SceneRecord, Workspace
from map3d.ingest.import_files import import_files
from map3d.ingest.import_options import ImportOptions
from tests.odd_cities.towns import houses, write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)


def write_town(folder: Path) -> Path:
    """Writes a town with the colours of a use map in its first theme and a photograph in its second."""
    path = write_citygml(folder / "town.gml", None, lambda corners: corners)
    names = [f"{name}-{k}" for name, faces in houses() for k in range(len(faces))]
    colored = "".join(f"<app:target>#{name}</app:target>" for name in names)
    textured = "".join(
        f'<app:target uri="#{name}"><app:TexCoordList><app:textureCoordinates ring="#{name}-r">0 0 1 0 1 1 0 1 0 0</app:textureCoordinates>'
        "</app:TexCoordList></app:target>"
        for name in names
    )
    use = f"<app:X3DMaterial><app:diffuseColor>0 0 1</app:diffuseColor>{colored}</app:X3DMaterial>"
    photo = f"<app:ParameterizedTexture><app:imageURI>wall.png</app:imageURI>{textured}</app:ParameterizedTexture>"
    themes = "".join(
        f"<app:appearanceMember><app:Appearance><app:theme>{theme}</app:theme><app:surfaceDataMember>{data}</app:surfaceDataMember>"
        "</app:Appearance></app:appearanceMember>"
        for theme, data in (("use", use), ("photos", photo))
    )
    path.write_text(path.read_text().replace("</core:CityModel>", f"{themes}</core:CityModel>"))
    Image.new("RGB", (8, 8), (200, 30, 30)).save(folder / "wall.png")
    return path


@pytest.mark.parametrize(("theme", "textures"), [(None, 1), ("photos", 1), ("use", 0)])
def test_the_theme_with_the_most_textures_is_drawn(tmp_path: Path, theme: str | None, textures: int) -> None:
    path = write_town(tmp_path)
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    (done,) = import_files(workspace, catalogue, "town", [path], ImportOptions(crs="local", theme=theme)).imported
    catalogue.close()
    assert len(list((workspace.asset_folder("town", "town") / "textures").glob("*"))) == textures
    used = [warning["example"] for warning in done.report["warnings"] if warning["reason"] == "appearance theme used"]
    assert used == ([] if theme else ["photos"])
