"""References between the CityGML files of a folder: geometry, prototypes, appearances."""

import gzip
import os
from pathlib import Path

import pytest
from PIL import Image

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import FilesImport, import_files
from map3d.formats.citygml_links import find_document_links, find_geometry_documents
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.sources import find_sources, source_digest
from tests.findings import warned

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

HEAD = '<CityModel xmlns:gml="http://www.opengis.net/gml" xmlns:xlink="http://www.w3.org/1999/xlink">'


def square(id: str, x: int) -> str:
    return (
        f'<gml:surfaceMember><gml:Polygon gml:id="{id}"><gml:exterior><gml:LinearRing gml:id="{id}-ring"><gml:posList>'
        f"{x} 0 0 {x + 2} 0 0 {x + 2} 2 0 {x} 2 0 {x} 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>"
    )


def building(id: str, members: str) -> str:
    surfaces = f"<lod2MultiSurface><gml:MultiSurface>{members}</gml:MultiSurface></lod2MultiSurface>"
    return f'<cityObjectMember><Building gml:id="{id}">{surfaces}</Building></cityObjectMember>'


def texture(image: str, uri: str) -> str:
    return (
        f"<appearanceMember><Appearance><theme>photos</theme><surfaceDataMember><ParameterizedTexture><imageURI>{image}</imageURI>"
        f'<target uri="{uri}"><TexCoordList><textureCoordinates ring="#{uri.partition("#")[2]}-ring">0 0 1 0 1 1 0 1 0 0</textureCoordinates>'
        "</TexCoordList></target></ParameterizedTexture></surfaceDataMember></Appearance></appearanceMember>"
    )


def write(path: Path, body: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{HEAD}{body}</CityModel>")
    return path


def write_city(folder: Path) -> Path:
    """Writes a town of two tiles, photographs for the first in a file of their own, and a library of prototypes without city objects."""
    write(folder / "tiles" / "a.gml", building("a", square("p", 0) + '<gml:surfaceMember xlink:href="../library/shapes.xml#shape"/>'))
    write(folder / "tiles" / "b.gml", building("b", square("p", 20) + '<gml:surfaceMember xlink:href="c.gml#gone"/>'))
    write(folder / "photos.gml", texture("images/red.png", "tiles/a.gml#p"))
    (folder / "library").mkdir()
    (folder / "library" / "shapes.xml").write_text(
        f'<Shapes xmlns:gml="http://www.opengis.net/gml"><gml:MultiSurface gml:id="shape">{square("s", 10)}</gml:MultiSurface></Shapes>'
    )
    (folder / "images").mkdir()
    Image.new("RGB", (4, 4), (200, 30, 30)).save(folder / "images" / "red.png")
    return folder


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    catalogue.close()
    return workspace


def add(workspace: Workspace, *paths: Path) -> FilesImport:
    catalogue = workspace.open_catalogue()
    try:
        return import_files(workspace, catalogue, "town", list(paths), ImportOptions(crs="local", skip_unchanged=True))
    finally:
        catalogue.close()


def textures_of(workspace: Workspace, name: str) -> int:
    return len(list((workspace.asset_folder("town", name) / "textures").iterdir()))


def test_a_folder_is_imported_with_the_geometry_and_appearances_that_its_files_share(tmp_path: Path, workspace: Workspace) -> None:
    done = add(workspace, write_city(tmp_path / "city"))
    assert {one.asset: one.triangles for one in done.imported} == {"a": 4, "b": 2}
    assert (done.failed, {note.code.partition("-as-")[0] for _, note in done.ignored}) == ([], {"used", "used-beside"})
    assert (textures_of(workspace, "a"), textures_of(workspace, "b")) == (1, 0)
    (missing,) = (warned(one.report) for one in done.imported if one.asset == "b")
    assert [(one["code"], one["count"], one["example"]) for one in missing] == [("other-file-not-found", 1, "c.gml#gone")]
    assert not warned(done.imported[0].report)


def test_libraries_may_be_packed_and_refer_to_others(tmp_path: Path, workspace: Workspace) -> None:
    city = write_city(tmp_path / "city")
    shapes, tile = city / "library" / "shapes.xml", city / "tiles" / "a.gml"
    more = shapes.read_text().replace('"shape"', '"more"').replace('"s"', '"t"')
    (city / "library" / "more.gml").write_text(more)
    link = '<gml:surfaceMember xmlns:xlink="http://www.w3.org/1999/xlink" xlink:href="more.gml#more"/></gml:MultiSurface>'
    (city / "library" / "shapes.gml.gz").write_bytes(gzip.compress(shapes.read_text().replace("</gml:MultiSurface>", link).encode()))
    shapes.unlink()
    tile.write_text(tile.read_text().replace("shapes.xml#", "shapes.gml.gz#"))
    done = add(workspace, city)
    assert {one.asset: one.triangles for one in done.imported} == {"a": 6, "b": 2}
    assert (done.failed, {note.code.partition("-as-")[0] for _, note in done.ignored}) == ([], {"used", "used-beside"})


@pytest.mark.parametrize(
    ("changed", "again"),
    [("photos.gml", ["a"]), ("library/shapes.xml", ["a"]), ("images/red.png", ["a"]), ("tiles/b.gml", ["b"]), ("tiles/a.gml", ["a"])],
)
def test_a_file_is_imported_again_when_one_that_it_has_something_of_changed(
    tmp_path: Path, workspace: Workspace, changed: str, again: list[str]
) -> None:
    city = write_city(tmp_path / "city")
    add(workspace, city)
    assert add(workspace, city).imported == []
    path = city / changed
    if path.suffix == ".png":
        Image.new("RGB", (4, 4), (0, 0, 200)).save(path)
    else:
        path.write_text(path.read_text() + "<!-- changed -->")
    assert [one.asset for one in add(workspace, city).imported] == again


def test_a_file_that_appears_is_noticed(tmp_path: Path, workspace: Workspace) -> None:
    city = write_city(tmp_path / "city")
    add(workspace, city)
    write(city / "tiles" / "c.gml", building("c", square("gone", 30)))
    assert {one.asset: one.triangles for one in add(workspace, city).imported} == {"b": 4, "c": 2}
    write(city / "more.gml", texture("images/red.png", "tiles/b.gml#p"))
    assert [one.asset for one in add(workspace, city).imported] == ["b"]
    assert textures_of(workspace, "b") == 1


def test_appearances_count_only_where_both_files_are_given(tmp_path: Path, workspace: Workspace) -> None:
    city = write_city(tmp_path / "city")
    add(workspace, city / "tiles" / "a.gml")
    assert textures_of(workspace, "a") == 0
    for name in ("a.gml", "photos.gml"):
        (tmp_path / "flat").mkdir(exist_ok=True)
        (tmp_path / "flat" / name).write_text((city / "tiles" / name if name == "a.gml" else city / name).read_text().replace("tiles/", ""))
    Image.new("RGB", (4, 4)).save(tmp_path / "flat" / "red.png")
    found = find_sources([tmp_path / "flat" / "a.gml", tmp_path / "flat" / "photos.gml"])
    assert [source.appearances for source in found] == [(tmp_path / "flat" / "photos.gml",), ()], "a file that is given itself is never left out"


def test_nothing_outside_the_given_folder_is_read(tmp_path: Path, workspace: Workspace) -> None:
    city = write_city(tmp_path / "city")
    write(tmp_path / "secret.gml", building("s", square("p", 40)))
    os.symlink(tmp_path / "secret.gml", city / "tiles" / "link.xml")
    body = building("b", square("p", 20) + "".join(f'<gml:surfaceMember xlink:href="{name}#p"/>' for name in ("../../secret.gml", "link.xml")))
    write(city / "tiles" / "b.gml", body)
    done = add(workspace, city / "tiles" / "b.gml", city)
    (report,) = (one.report for one in done.imported if one.asset == "b" and "b" in one.source)
    assert (report["triangles"], warned(report)[0]["count"]) == (2, 2)
    assert warned(report)[0]["code"] == "other-file-outside-folder"
    assert find_document_links(city / "tiles" / "b.gml", city).geometry == frozenset()


def test_links_are_found_however_they_are_written(tmp_path: Path) -> None:
    for name in ("b.gml", "c d.xml", "e.gml.gz", "f.GML"):
        (tmp_path / name).write_bytes(b"")
    path = tmp_path / "a.gml"
    path.write_text(
        "<a x:href='b.gml#1'/><a x:href=\"c%20d.xml#1\"/><target> e.gml.gz#1</target><target uri='f.GML#1' x:href='#2'/>"
        '<a srsName="http://www.opengis.net/gml/srs/epsg.xml#4326" x:href="a.gml#3"/><a x:href="none.gml#1"/>'
    )
    links = find_document_links(path)
    assert {found.name for found in links.geometry} == {"b.gml", "c d.xml"}
    assert {found.name for found in links.targets} == {"e.gml.gz", "f.GML"}
    assert not links.has_objects


def test_cycles_of_files_end(tmp_path: Path) -> None:
    for name, other in (("a.gml", "b.gml"), ("b.gml", "a.gml"), ("c.gml", "a.gml")):
        write(tmp_path / name, building("x", f'<gml:surfaceMember xlink:href="{other}#x"/>'))
    assert find_geometry_documents(tmp_path / "c.gml") == {tmp_path / "a.gml", tmp_path / "b.gml"}
    before = source_digest(find_sources([tmp_path / "c.gml"])[0])
    write(tmp_path / "b.gml", "")
    assert source_digest(find_sources([tmp_path / "c.gml"])[0]) != before
