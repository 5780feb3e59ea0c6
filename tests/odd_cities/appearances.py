"""Appearances for the boxes of `towns.houses`: transparencies of walls and roofs, and two themes for the same surfaces."""

from pathlib import Path

from PIL import Image

from tests.odd_cities.towns import houses

FACES = 6
"""Faces of a box; the first two are its ground and its roof."""


def add_transparency(path: Path, walls: str, roofs: str, *, side: int = 4, prefix: str = "") -> Path:
    """Gives the walls and the roofs of a town these transparencies."""
    materials = "".join(
        f"<app:surfaceDataMember><app:X3DMaterial><app:transparency>{value}</app:transparency>"
        + "".join(f"<app:target>#{prefix}{name}-{k}</app:target>" for name, _ in houses(side) for k in range(FACES) if (k < 2) == is_roof)
        + "</app:X3DMaterial></app:surfaceDataMember>"
        for value, is_roof in ((walls, False), (roofs, True))
    )
    return _add(path, f"<app:appearanceMember><app:Appearance><app:theme>t</app:theme>{materials}</app:Appearance></app:appearanceMember>")


def add_themes(path: Path, *, side: int = 4, prefix: str = "") -> Path:
    """Gives a town the blue of a use map in its first theme and a red photograph, wall.png beside it, in its second."""
    names = [f"{prefix}{name}-{k}" for name, _ in houses(side) for k in range(FACES)]
    colored = "".join(f"<app:target>#{name}</app:target>" for name in names)
    textured = "".join(
        f'<app:target uri="#{name}"><app:TexCoordList><app:textureCoordinates ring="#{name}-r">0 0 1 0 1 1 0 1 0 0</app:textureCoordinates>'
        "</app:TexCoordList></app:target>"
        for name in names
    )
    use = f"<app:X3DMaterial><app:diffuseColor>0 0 1</app:diffuseColor>{colored}</app:X3DMaterial>"
    photo = f"<app:ParameterizedTexture><app:imageURI>wall.png</app:imageURI>{textured}</app:ParameterizedTexture>"
    Image.new("RGB", (8, 8), (200, 30, 30)).save(path.with_name("wall.png"))
    return _add(
        path,
        "".join(
            f"<app:appearanceMember><app:Appearance><app:theme>{theme}</app:theme><app:surfaceDataMember>{data}</app:surfaceDataMember>"
            "</app:Appearance></app:appearanceMember>"
            for theme, data in (("use", use), ("photos", photo))
        ),
    )


def _add(path: Path, appearances: str) -> Path:
    path.write_text(path.read_text().replace("</core:CityModel>", f"{appearances}</core:CityModel>"))
    return path
