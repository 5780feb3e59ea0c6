"""Rows of images and of what documents say of their surfaces (docs/odd-files.md, Images)."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from PIL import Image

from tests.odd_cities.appearances import FACES, add_themes
from tests.odd_cities.contradictions import Row
from tests.odd_cities.rows_of_plan import only
from tests.odd_cities.towns import MUNICH, at, houses, write_citygml

_UTM: Final = at(*MUNICH, "EPSG:32632")


def _town(folder: Path) -> Path:
    return write_citygml(folder / "town.gml", "EPSG:32632", _UTM)


def _themes(folder: Path) -> Path:
    return add_themes(_town(folder))


def _replace(path: Path, before: str, after: str) -> None:
    path.write_text(path.read_text().replace(before, after))


def _cut_image(folder: Path) -> None:
    photo = _themes(folder).with_name("wall.png")
    photo.write_bytes(photo.read_bytes()[:-20])


def _other_case(folder: Path) -> None:
    _replace(_themes(folder), "wall.png", "Wall.PNG")


def _windows_drive(folder: Path) -> None:
    _replace(_themes(folder), "wall.png", "C:\\City\\wall.png")


def _missing_images(folder: Path) -> None:
    _themes(folder).with_name("wall.png").unlink()


def _inks(folder: Path) -> None:
    photo = _themes(folder).with_name("wall.png")
    Image.new("CMYK", (8, 8), (0, 200, 200, 20)).save(photo.with_name("wall.jpg"))
    photo.unlink()
    _replace(folder / "town.gml", "wall.png", "wall.jpg")


def _dangling_targets(folder: Path) -> None:
    path = _themes(folder)
    for name, _ in houses():
        for face in range(FACES):
            _replace(path, f'uri="#{name}-{face}"', f'uri="#{name}-{face}_X"')


def _ring_targets(folder: Path) -> None:
    path = _themes(folder)
    for name, _ in houses():
        for face in range(FACES):
            _replace(path, f'uri="#{name}-{face}"', f'uri="#{name}-{face}-r"')


def _ended(folder: Path) -> None:
    begin = '<bldg:Building gml:id="house-1-1">'
    _replace(_town(folder), begin, f"{begin}<core:terminationDate>2010-01-01</core:terminationDate>")


def _service_answer(folder: Path) -> None:
    path = _town(folder)
    _replace(path, "xmlns:core", 'xmlns:wfs="http://www.opengis.net/wfs/2.0" xmlns:core')
    _replace(path, "core:CityModel", "wfs:FeatureCollection")
    _replace(path, "core:cityObjectMember", "wfs:member")


def _utf_16(folder: Path) -> None:
    path = _town(folder)
    path.write_bytes(path.read_text().encode("utf-16-le"))


def _row(name: str, build: Callable[[Path], Any], *said: str, textures: int = 0, objects: int = 16, **options: str) -> Row:
    return Row(name, build, *only("EPSG:32632", MUNICH), objects, said, options, textures=textures)


IMAGES: list[Row] = [
    _row("a photograph that is cut", _cut_image, "image-damaged", "appearance-of-other-theme", "theme-used"),
    _row("a photograph whose name differs in case", _other_case, "file-name-case-differs", "appearance-of-other-theme", "theme-used", textures=1),
    _row("a photograph with a foreign path", _windows_drive, "file-name-absolute", "appearance-of-other-theme", "theme-used", textures=1),
    _row("a photograph in CMYK", _inks, "appearance-of-other-theme", "theme-used", textures=1),
    _row("a theme whose images are missing", _missing_images, "appearance-of-other-theme", "theme-used", "theme-without-images"),
    _row("targets that are not in the file", _dangling_targets, "appearance-target-missing", "appearance-of-other-theme", "theme-used"),
    _row("targets that name rings", _ring_targets, "appearance-target-is-ring", "appearance-of-other-theme", "theme-used", textures=1),
    _row("a version that has ended", _ended, "version-ended", objects=15),
    _row("a version that has ended, at an earlier date", _ended, at="2005-01-01"),
    _row("the answer of a web feature service", _service_answer),
    _row("UTF-16 without a mark", _utf_16),
]
