"""Names of files that differ from those on disk: found and drawn, or named as missing, never both."""

import os
import unicodedata
from pathlib import Path

import pytest
from PIL import Image

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import import_files
from map3d.ingest.import_options import ImportOptions
from tests.findings import warned
from tests.odd_cities.towns import HEAD

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

NAME = "tex/Fassade ä.jpg"
NFD = unicodedata.normalize("NFD", NAME)
RING = "0 0 0 8 0 0 8 8 0 0 8 0 0 0 0"


def write_gml(folder: Path, name: str, encoding: str = "utf-8") -> None:
    texture = (
        "<app:appearanceMember><app:Appearance><app:surfaceDataMember><app:ParameterizedTexture>"
        f'<app:imageURI>{name}</app:imageURI><app:target uri="#p"><app:TexCoordList><app:textureCoordinates ring="#r">0 0 1 0 1 1 0 1 0 0'
        "</app:textureCoordinates></app:TexCoordList></app:target></app:ParameterizedTexture></app:surfaceDataMember></app:Appearance></app:appearanceMember>"
    )
    building = (
        '<core:cityObjectMember><bldg:Building gml:id="b"><bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember><gml:Polygon gml:id="p">'
        f'<gml:exterior><gml:LinearRing gml:id="r"><gml:posList>{RING}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon>'
        "</gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface></bldg:Building></core:cityObjectMember>"
    )
    text = f"{HEAD}{texture}{building}</core:CityModel>"
    declared = "utf-16" if encoding.startswith("utf-16") else encoding
    (folder / "town.gml").write_bytes(text.replace("UTF-8", declared).encode(encoding))


def write_obj(folder: Path, name: str) -> None:
    (folder / "town.mtl").write_text(f"newmtl wall\nmap_Kd {name}\n", encoding="utf-8")
    (folder / "town.obj").write_text("mtllib town.mtl\nusemtl wall\nvt 0 0\nvt 1 0\nvt 1 1\nv 0 0 0\nv 8 0 0\nv 8 0 6\nf 1/1 2/2 3/3\n")


def drawn_and_missing(tmp_path: Path, city: Path) -> tuple[int, int, list[str], list[str]]:
    """Imports a folder; returns the numbers of images drawn and missing, the names of missing files, and the codes that are said of names."""
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    (done,) = import_files(workspace, catalogue, "town", [city], ImportOptions(crs="local")).imported
    catalogue.close()
    images = len(list((workspace.asset_folder("town", "town") / "textures").iterdir()))
    codes = sorted({item["code"] for item in warned(done.report) if item["code"].startswith(("file-name", "image"))})
    return images, done.report["textures"]["missing"], done.report.get("missing_files", []), codes


def make_city(tmp_path: Path, on_disk: str) -> Path:
    (tmp_path / "city" / on_disk).parent.mkdir(parents=True)
    Image.new("RGB", (8, 8), (200, 30, 30)).save(tmp_path / "city" / on_disk, "JPEG")
    return tmp_path / "city"


@pytest.mark.parametrize(
    ("on_disk", "written", "codes"),
    [
        (NAME, NAME, []),
        (NFD, NAME, []),
        (NAME, NFD, []),
        (NFD, NAME.upper(), ["file-name-case-differs"]),
        (NAME, "TEX/Fassade ä.JPG", ["file-name-case-differs"]),
        (NAME, '"tex/Fassade ä.jpg"', []),
        (NAME, "./tex/Fassade ä.jpg", []),
        (NAME, "tex\\Fassade ä.jpg", ["file-name-backslashes"]),
        (NAME, "tex\\fassade ä.jpg", ["file-name-case-differs"]),
        (NAME, "tex/Fassade%20%C3%A4.jpg", ["file-name-percent-encoded"]),
        (NFD, "tex/Fassade%20%C3%A4.jpg", []),
        (NAME, "/tex/Fassade ä.jpg", ["file-name-absolute"]),
        (NAME, "/home/someone/city/tex/Fassade ä.jpg", ["file-name-absolute"]),
        (NAME, "C:\\Projects\\City\\tex\\Fassade ä.jpg", ["file-name-absolute"]),
        (NFD, "C:/Projects/City/TEX/Fassade ä.jpg", ["file-name-absolute"]),
        (NAME, "\\\\server\\share\\tex\\Fassade ä.jpg", ["file-name-absolute"]),
        (NAME, "file:tex/Fassade ä.jpg", []),
        (NAME, "file:///C:/City/tex/Fassade%20%C3%A4.jpg", ["file-name-absolute"]),
        (NAME, "file:///tex/Fassade ä.jpg", ["file-name-absolute"]),
        (NAME, "file://server/share/tex/Fassade ä.jpg", ["file-name-absolute"]),
        ("Fassade ä.jpg", "C:\\Textures\\Fassade ä.jpg", ["file-name-absolute"]),
    ],
)
@pytest.mark.parametrize("write", [write_gml, write_obj])
def test_a_name_that_is_found_is_not_missing(tmp_path: Path, on_disk: str, written: str, codes: list[str], write) -> None:
    city = make_city(tmp_path, on_disk)
    write(city, written)
    # Quotes are part of the statement in a material library, and part of the name in XML.
    assert drawn_and_missing(tmp_path, city) == (1, 0, [], codes)


@pytest.mark.parametrize(
    ("written", "code"),
    [
        ("tex/other.jpg", "image-file-not-found"),
        ("../secret.jpg", "image-file-outside-folder"),
        ("C:\\Textures\\other.jpg", "image-file-outside-folder"),
        ("/tex/other.jpg", "image-file-outside-folder"),
        ("file:///tex/other.jpg", "image-file-outside-folder"),
        ("tex", "image-not-a-regular-file"),
    ],
)
@pytest.mark.parametrize("write", [write_gml, write_obj])
def test_a_name_that_is_missing_is_not_drawn(tmp_path: Path, written: str, code: str, write) -> None:
    city = make_city(tmp_path, NAME)
    Image.new("RGB", (8, 8)).save(tmp_path / "secret.jpg")
    write(city, written)
    assert drawn_and_missing(tmp_path, city) == (0, 1, [written], [code])


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-16", "iso-8859-1"])
def test_names_in_documents_of_other_encodings(tmp_path: Path, encoding: str) -> None:
    city = make_city(tmp_path, NAME)
    write_gml(city, NAME, encoding)
    assert drawn_and_missing(tmp_path, city) == (1, 0, [], [])


def test_a_name_that_zip_programs_wrote_in_windows_1252(tmp_path: Path) -> None:
    city = make_city(tmp_path, "a.jpg")
    (city / "tex").mkdir()
    os.rename(city / "a.jpg", os.fsencode(city) + b"/tex/Fassade \xe4.jpg")
    write_gml(city, NAME)
    assert drawn_and_missing(tmp_path, city)[:3] == (1, 0, [])
