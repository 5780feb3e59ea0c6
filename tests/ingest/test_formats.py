"""Formats are detected by content."""

from pathlib import Path

import pytest
from rasterio.shutil import copy

from map3d.errors import NotFound, UnknownFormat
from map3d.formats.detect import detect_format
from map3d.formats.raster import RASTER_FORMATS, RasterFormat, find_raster_format
from map3d.ingest.sources import find_sources
from map3d.ingest.terrain.raster_georeference import open_raster
from tests.ingest.terrain.rasters import colours, hills, write

CITY = '<?xml version="1.0"?>\n<!-- a <b> comment -->\n<core:CityModel xmlns:core="http://www.opengis.net/citygml/2.0"/>'
OBJ = "# made by hand\nmtllib a.mtl\no thing\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.mark.parametrize(
    ("name", "content", "format"),
    [
        ("a.gml", CITY.encode(), "citygml"),
        ("a.weird", CITY.encode(), "citygml"),
        ("bom.xml", b"\xef\xbb\xbf" + CITY.encode(), "citygml"),
        ("utf16.xml", b"\xff\xfe" + CITY.encode("utf-16-le"), "citygml"),
        ("space.xml", b"  \n" + CITY.encode(), "citygml"),
        ("nobom.xml", CITY.encode("utf-16-be"), "citygml"),
        ("a.obj", OBJ.encode(), "obj"),
        ("a.txt", OBJ.encode(), "obj"),
        ("dos.obj", OBJ.replace("\n", "\r\n").encode(), "obj"),
        ("utf16.obj", OBJ.encode("utf-16"), "obj"),
        ("long.obj", b"v 0 0 0\n" * 20_000, "obj"),
        ("a.tif", b"II*\0rest", "raster"),
        ("big.tif", b"MM\0+rest", "raster"),
        ("a.jp2", b"\0\0\0\x0cjP  \r\n", "raster"),
        ("a.asc", b"NCOLS 3\nnrows 2\n", "raster"),
    ],
)
def test_formats_are_detected_by_content(tmp_path: Path, name: str, content: bytes, format: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    assert detect_format(path).name == format


@pytest.mark.parametrize(
    ("content", "description"),
    [
        (b"", "an empty file"),
        (b"glTF\2\0\0\0", "glTF"),
        (b'{"type": "CityJSON"}', "JSON"),
        (b"<html><body/></html>", "XML with root element html"),
        (b"<!-- only a comment -->", "XML without a root"),
        (b"PK\3\4", "ZIP"),
        (b"\x89PNG\r\n", "a PNG image without a world file"),
        (b"\xff\xd8\xff\xe0", "a JPEG image without a world file"),
        (
            b"<VRTDataset/>",
            "a virtual raster, which map3d reads only on its own command line (map3d add-files); convert it with gdal_translate -of COG",
        ),
        (b"just some words\nand more\n", "unknown format"),
        (b"v 0 0 0\0\0\0", "unknown format"),
        (b"v 0 0 0\nword", "unknown format"),
        (b"<!-- <CityModel> is never closed", "XML without a root"),
        ("{}".encode("utf-16"), "JSON"),
    ],
)
def test_unknown_formats_are_refused_with_the_list_of_readable_ones(tmp_path: Path, content: bytes, description: str) -> None:
    path = tmp_path / "a.gml"
    path.write_bytes(content)
    with pytest.raises(UnknownFormat, match="map3d reads CityGML") as refused:
        detect_format(path)
    assert description in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("image", "world_file"), [("a.jpg", "a.jgw"), ("a.JPG", "a.JGW"), ("a.jpeg", "a.wld"), ("a.png", "a.pgw")])
def test_an_image_with_a_world_file_is_a_raster(tmp_path: Path, image: str, world_file: str) -> None:
    path = tmp_path / image
    path.write_bytes(b"\x89PNG\r\n" if path.suffix == ".png" else b"\xff\xd8\xff\xe0")
    (tmp_path / world_file).write_text("1\n0\n0\n-1\n0\n0\n")
    assert detect_format(path).name == "raster"


@pytest.mark.parametrize("format", RASTER_FORMATS, ids=lambda format: format.driver)
def test_what_gdal_writes_as_a_raster_is_opened_with_the_same_driver(tmp_path: Path, format: RasterFormat) -> None:
    source = write(tmp_path / "source.tif", hills(12, 10) if format.driver == "AAIGrid" else colours(12, 10))
    path = tmp_path / "raster.any"
    copy(source, path, driver=format.driver, WORLDFILE="YES")
    assert find_raster_format(path.read_bytes()) is format
    assert detect_format(path).name == "raster"
    with open_raster(path) as raster:
        assert (raster.driver, raster.width, raster.height) == (format.driver, 10, 12)
    if format.is_image:
        path.with_suffix(".wld").unlink()
        with pytest.raises(UnknownFormat, match=f"a {format.driver} image without a world file"):
            detect_format(path)


def test_an_ascii_grid_may_have_wide_columns(tmp_path: Path) -> None:
    path = tmp_path / "dem.asc"
    heads = {"ncols": 2, "nrows": 2, "xllcorner": 0, "yllcorner": 0, "cellsize": 1}
    path.write_text("".join(f"{name:<30}{value}\n" for name, value in heads.items()) + "1 2\n3 4\n")
    assert detect_format(path).name == "raster"
    with open_raster(path) as raster:
        assert raster.read(1).tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize("suffix", sorted({suffix for format in RASTER_FORMATS for suffix in format.world_files}))
def test_world_files_are_listed_as_used(tmp_path: Path, suffix: str) -> None:
    write(tmp_path / "dem.tif", hills(4, 4))
    (tmp_path / f"dem{suffix}").write_text("1\n0\n0\n-1\n0\n0\n")
    notes: list[tuple[str, str]] = []
    find_sources([tmp_path], on_note=lambda path, note: notes.append((path.name, note.code)))
    assert notes == [(f"dem{suffix}", "used-beside")]


@pytest.mark.parametrize(("name", "driver"), [("a.ecw", "ECW"), ("a.sid", "MrSID"), ("a.IMG", "HFA")])
def test_rasters_that_need_another_driver_name_it_and_the_conversion(tmp_path: Path, name: str, driver: str) -> None:
    (tmp_path / name).write_bytes(b"e\2\0\0")
    with pytest.raises(UnknownFormat, match=rf"\(GDAL driver {driver}\); convert it with gdal_translate -of COG"):
        detect_format(tmp_path / name)


def test_a_missing_file_is_not_found(tmp_path: Path) -> None:
    with pytest.raises(NotFound):
        detect_format(tmp_path / "nothing")
