"""`publish --gis`: colour tiles as files, with layer definitions."""

import hashlib
from xml.etree import ElementTree

import pytest
from pyproj import CRS

from map3d.errors import BadRequest
from map3d.publish import publish
from map3d.publish.checksums import CHECKSUMS, parse_checksums
from tests.web.workspaces import every_tile, tile_bytes


def gis_files(out):
    return {path.relative_to(out).as_posix() for path in (out / "gis").rglob("*") if path.is_file()}


def test_without_the_option_there_are_none(workspace, out):
    publish(workspace, "tea", out)
    assert not (out / "gis").exists()


def test_tiles_keep_their_bytes_and_definitions_name_them(workspace, out):
    done = publish(workspace, "tea", out, gis=True)
    tiles = {
        f"gis/{view}/color/{tile.z}/{tile.x}/{tile.y}.webp": tile_bytes(view, "color", tile) for view in ("0-45", "45-22.5") for tile in every_tile()
    }
    definitions = {f"gis/{view}{end}" for view in ("0-45", "45-22.5") for end in (".wkt", "-color.xml", "-color.qlr")}
    assert gis_files(out) == tiles.keys() | definitions
    assert all((out / name).read_bytes() == data for name, data in tiles.items())
    window = ElementTree.parse(out / "gis/0-45-color.xml").getroot()
    assert window.findtext("Service/ServerUrl") == f"{out.absolute().as_uri()}/gis/0-45/color/${{z}}/${{x}}/${{y}}.webp"
    assert CRS.from_wkt((out / "gis/0-45.wkt").read_text()).name == CRS.from_wkt(window.findtext("Projection")).name
    assert "gis" in [row.part for row in done.sizes]
    digests = parse_checksums((out / CHECKSUMS).read_bytes())
    assert digests["gis/0-45.wkt"] == hashlib.sha256((out / "gis/0-45.wkt").read_bytes()).hexdigest()


def test_an_address_is_named_instead_of_the_folder(workspace, out):
    publish(workspace, "tea", out, gis=True, url="https://example.org/tea/")
    layer = ElementTree.parse(out / "gis/45-22.5-color.qlr").getroot()
    assert "https://example.org/tea/gis/45-22.5/color/${z}/${x}/${y}.webp" in layer.findtext("maplayers/maplayer/datasource")


def test_publishing_again_without_the_option_removes_them(workspace, out):
    publish(workspace, "tea", out, gis=True)
    publish(workspace, "tea", out)
    assert not (out / "gis").exists()


def test_an_object_store_needs_the_address(workspace, tmp_path):
    with pytest.raises(BadRequest, match="--url"):
        publish(workspace, "tea", (tmp_path / "store").as_uri(), gis=True)
