"""A file has one role: what documents use is listed as used, is not imported again, and never fails."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import FilesImport, import_files
from map3d.ingest.file_notes import note_lines
from map3d.ingest.import_options import ImportOptions
from map3d.site.files import ImportSummary, SiteFiles, update_files
from tests.cli.towns import Run, house
from tests.ingest.terrain.rasters import NORTH, WEST, colours, hills, write
from tests.odd_cities.towns import HEAD, MUNICH, at, write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)


def triangle(name: str, appearance: str) -> str:
    """Returns a building of one triangle, and an appearance with `{ring}` and `{polygon}` in place of its ids."""
    corners = f"{WEST} {NORTH} 500 {WEST + 10} {NORTH} 500 {WEST + 10} {NORTH + 10} 500 {WEST} {NORTH} 500"
    surface = (
        f'<gml:Polygon gml:id="{name}-p" srsName="EPSG:25832" srsDimension="3"><gml:exterior><gml:LinearRing gml:id="{name}-r">'
        f"<gml:posList>{corners}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon>"
    )
    return (
        f"<app:appearanceMember><app:Appearance>{appearance.format(ring=f'{name}-r', polygon=f'{name}-p')}</app:Appearance></app:appearanceMember>"
        f'<core:cityObjectMember><bldg:Building gml:id="{name}"><bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember>{surface}'
        "</gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface></bldg:Building></core:cityObjectMember>"
    )


def parameterized(image: str) -> str:
    return (
        f"<app:surfaceDataMember><app:ParameterizedTexture><app:imageURI>{image}</app:imageURI>"
        '<app:target uri="#{polygon}"><app:TexCoordList><app:textureCoordinates ring="#{ring}">0 0 1 0 1 1 0 0</app:textureCoordinates>'
        "</app:TexCoordList></app:target></app:ParameterizedTexture></app:surfaceDataMember>"
    )


def georeferenced(image: str) -> str:
    return (
        f"<app:surfaceDataMember><app:GeoreferencedTexture><app:imageURI>{image}</app:imageURI>"
        "<app:target>#{polygon}</app:target></app:GeoreferencedTexture></app:surfaceDataMember>"
    )


def write_document(path: Path, *appearances: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    members = "".join(triangle(f"b{number}", appearance) for number, appearance in enumerate(appearances))
    path.write_text(f"{HEAD}{members}</core:CityModel>\n")
    return path


def write_photo(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.moveaxis(colours(20, 20), 0, -1)).save(path)
    return path


def write_world_file(image: Path, suffix: str) -> None:
    image.with_suffix(suffix).write_text(f"1\n0\n0\n-1\n{WEST + 0.5}\n{NORTH + 19.5}\n")


def add(tmp_path: Path, *paths: Path, **options: object) -> tuple[FilesImport, Workspace]:
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    try:
        return import_files(workspace, catalogue, "town", list(paths), ImportOptions(**options)), workspace  # type: ignore[arg-type]
    finally:
        catalogue.close()


def notes(done: FilesImport | ImportSummary) -> dict[str, str]:
    """Returns file → what is said of it, without files that only accompany others."""
    return {Path(file).name: f"{note.code}: {note.values.get('of')}" for file, note in done.ignored if note.code != "used-beside"}


@pytest.mark.parametrize(("image", "world"), [("ortho.jpg", ".jgw"), ("ortho.png", ".pgw"), ("ortho.tif", ".tfw")])
def test_a_georeferenced_texture_is_no_photo_of_its_own(tmp_path: Path, image: str, world: str) -> None:
    city = tmp_path / "city"
    write_document(city / "town.gml", georeferenced(image))
    write_world_file(write_photo(city / image), world)
    done, workspace = add(tmp_path, city)
    assert [(item.asset, item.triangles) for item in done.imported] == [("town", 1)]
    assert (done.failed, notes(done)) == ([], {image: "used-as-texture: town.gml"})
    assert len(list((workspace.asset_folder("town", "town") / "textures").iterdir())) == 1


def test_a_given_photo_is_read_though_a_document_uses_it(tmp_path: Path) -> None:
    city = tmp_path / "city"
    document = write_document(city / "town.gml", georeferenced("ortho.jpg"))
    write_world_file(photo := write_photo(city / "ortho.jpg"), ".jgw")
    done, _ = add(tmp_path, document, photo)
    assert [item.asset for item in done.imported] == ["town", "ortho"]


def test_tiff_textures_do_not_fail_and_terrain_stays(tmp_path: Path) -> None:
    city = tmp_path / "city"
    names = [f"tex/tk{number}.tif" for number in range(3)]
    write_document(city / "town.gml", *map(parameterized, names))
    for name in names:
        write_photo(city / name)
    write(city / "dem.tif", hills(20, 20))
    done, workspace = add(tmp_path, city, strict=True)
    assert {item.asset: item.format for item in done.imported} == {"town": "citygml", "dem": "raster"}
    assert done.imported[1].report["rasters"] == {"elevation": 1, "imagery": 0}
    assert (done.failed, notes(done)) == ([], {Path(name).name: "used-as-texture: town.gml" for name in names})
    assert [str(line) for line in note_lines(done.ignored)] == [
        f"used by other files: {', '.join(str(city / name) for name in names)} (texture of town.gml)"
    ]
    assert len(list((workspace.asset_folder("town", "town") / "textures").iterdir())) == 1, "the three images are equal"


def test_a_texture_of_several_documents_is_listed_once(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_document(tmp_path / "city" / f"{name}.gml", parameterized("wall.tif"), *([georeferenced("wall.tif")] * (name == "b")))
    write_photo(tmp_path / "city" / "wall.tif")
    done, _ = add(tmp_path, tmp_path / "city")
    assert [item.asset for item in done.imported] == ["a", "b"]
    assert notes(done) == {"wall.tif": "used-as-texture: a.gml"}


def test_textures_of_an_obj_are_no_photos(tmp_path: Path) -> None:
    city = tmp_path / "city"
    (city / "maps").mkdir(parents=True)
    (city / "h.obj").write_text("mtllib h.mtl\nusemtl wall\nvt 0 0\nvt 1 0\nvt 1 1\nv 0 0 0\nv 8 0 0\nv 8 0 6\nf 1/1 2/2 3/3\n")
    (city / "h.mtl").write_text("newmtl wall\nmap_Kd maps/wall.jpg\n")
    write_world_file(write_photo(city / "maps" / "wall.jpg"), ".jgw")
    done, _ = add(tmp_path, city, crs="local")
    assert [item.asset for item in done.imported] == ["h"]
    assert notes(done) == {"wall.jpg": "used-as-texture: h.obj"}


def test_a_model_of_a_library_is_not_drawn_at_its_own_origin(tmp_path: Path) -> None:
    city = tmp_path / "city"
    placed = (
        "<core:cityObjectMember><veg:SolitaryVegetationObject gml:id='tree' xmlns:veg='http://www.opengis.net/citygml/vegetation/2.0'>"
        "<veg:lod2ImplicitRepresentation><core:ImplicitGeometry><core:mimeType>model/obj</core:mimeType>"
        "<core:transformationMatrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</core:transformationMatrix><core:libraryObject>lib/tree.obj</core:libraryObject>"
        "<core:referencePoint><gml:Point srsName='EPSG:25832' srsDimension='3'>"
        f"<gml:pos>{WEST} {NORTH} 500</gml:pos></gml:Point></core:referencePoint>"
        "</core:ImplicitGeometry></veg:lod2ImplicitRepresentation></veg:SolitaryVegetationObject></core:cityObjectMember>"
    )
    (city / "lib").mkdir(parents=True)
    (city / "town.gml").write_text(f"{HEAD}{placed}</core:CityModel>\n")
    (city / "lib" / "tree.obj").write_text(house(0, 0, 6))
    done, _ = add(tmp_path, city)
    assert [item.asset for item in done.imported] == ["town"]
    assert notes(done) == {"tree.obj": "used-as-geometry: town.gml"}


def test_the_copy_of_a_texture_is_no_photo_either(tmp_path: Path) -> None:
    city = tmp_path / "city"
    write_document(city / "town.gml", georeferenced("ortho.jpg"))
    for name in ("ortho", "ortho (1)"):
        write_world_file(write_photo(city / f"{name}.jpg"), ".jgw")
    done, _ = add(tmp_path, city)
    assert [item.asset for item in done.imported] == ["town"]
    assert notes(done) == {"ortho.jpg": "used-as-texture: town.gml", "ortho (1).jpg": "left-same-content: ortho.jpg"}


def update(workspace: Workspace, city: Path) -> ImportSummary:
    catalogue = workspace.open_catalogue()
    try:
        return update_files(workspace, catalogue, SiteFiles(SceneRecord("town"), city), lambda *_: None)
    finally:
        catalogue.close()


def test_a_file_that_is_no_document_any_more_leaves_the_site(tmp_path: Path) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    write_document(city / "town.gml", parameterized("other.jpg"))
    write_world_file(write_photo(city / "ortho.jpg"), ".jgw")
    write_citygml(city / "b.gml", "EPSG:25832", at(*MUNICH, "EPSG:25832"), side=1)
    assert sorted(update(workspace, city).imported) == ["b", "ortho", "town"]
    write_document(city / "town.gml", georeferenced("ortho.jpg"))
    (city / "b.gml.bak").write_bytes((city / "b.gml").read_bytes())
    again = update(workspace, city)
    assert (again.imported, again.unchanged, again.removed) == (["town"], ["b"], ["ortho"])
    assert notes(again) == {"ortho.jpg": "used-as-texture: town.gml", "b.gml.bak": "left-backup: b.gml"}


def test_a_site_says_which_files_keep_what_they_held_before(tmp_path: Path) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    write_document(city / "town.gml", parameterized("a.jpg"))
    write_citygml(city / "b.xml", "EPSG:25832", at(*MUNICH, "EPSG:25832"), side=1)
    write_citygml(city / "c.gml", "EPSG:25832", at(MUNICH[0] + 0.001, MUNICH[1], "EPSG:25832"), side=1)
    assert sorted(update(workspace, city).imported) == ["b", "c", "town"]
    (city / "town.gml").write_text("<html>Not found</html>")
    (city / "b.xml").write_text("<html>Not found</html>")
    again = update(workspace, city)
    assert (again.unchanged, again.removed) == (["c"], [])
    assert {Path(file).name: reason.code for file, reason in again.failed} == {
        "town.gml": "failed-with-earlier-content",
        "b.xml": "about",
    }
    assert all("keeps what the file held before" in str(reason) for _, reason in again.failed)


def test_a_site_that_is_published_without_some_files_exits_with_3(tmp_path: Path, run: Run) -> None:
    city = tmp_path / "city"
    write_citygml(city / "town.gml", "EPSG:25832", at(*MUNICH, "EPSG:25832"), side=1)
    (city / "page.gml").write_text("<html>Not found</html>")
    options = ("--res", "1", "--view", "0-90", "--workers", "1")
    status, _, err = run("site", "city", "-o", "site", *options)
    assert (status, (tmp_path / "site" / "index.html").is_file()) == (3, True)
    assert "not imported" in err
    assert "published, but 1 file could not be read, or not as a whole\n" in err
    status, _, err = run("site", "city", "-o", "strict", "--name", "strict", "--strict", *options)
    assert (status, (tmp_path / "strict").exists()) == (2, False)
    (city / "page.gml").unlink()
    assert run("site", "city", "-o", "site", *options)[0] == 0


def test_archives_in_a_site_follow_their_content(tmp_path: Path) -> None:
    workspace, city = Workspace(tmp_path / "workspace").create(), tmp_path / "city"
    first = write_citygml(tmp_path / "a.gml", "EPSG:25832", at(*MUNICH, "EPSG:25832"), side=1, prefix="a-")
    second = write_citygml(tmp_path / "b.gml", "EPSG:25832", at(MUNICH[0] + 0.001, MUNICH[1], "EPSG:25832"), side=1, prefix="b-")
    write(tmp_path / "dem.tif", hills(20, 20))
    (city / "deep").mkdir(parents=True)

    def pack(*paths: Path) -> None:
        with zipfile.ZipFile(city / "deep" / "town.zip", "w") as archive:
            for path in paths:
                archive.write(path, f"data/{path.name}")

    pack(first, second, tmp_path / "dem.tif")
    done = update(workspace, city)
    assert sorted(done.imported) == ["a", "b", "dem"]
    catalogue = workspace.open_catalogue()
    places = {asset.name: asset.source for asset in catalogue.assets("town")}
    catalogue.close()
    assert places["a"] == str(city / "deep" / "town.zip" / "data" / "a.gml")
    assert sorted(update(workspace, city).unchanged) == ["a", "b", "dem"]

    write_citygml(second, "EPSG:25832", at(MUNICH[0] + 0.002, MUNICH[1], "EPSG:25832"), side=1, prefix="b-")
    pack(second, tmp_path / "dem.tif")
    done = update(workspace, city)
    assert (done.imported, done.unchanged, done.removed) == (["b"], ["dem"], ["a"])

    packed = (city / "deep" / "town.zip").read_bytes()
    (city / "deep" / "town.zip").write_bytes(packed[: len(packed) // 2])
    (city / "c.gml").write_bytes(first.read_bytes())
    done = update(workspace, city)
    assert (done.imported, done.removed) == (["c"], [])
    ((file, reason),) = done.failed
    assert (Path(file).name, reason.code) == ("town.zip", "failed-with-earlier-content")

    (city / "deep" / "town.zip").rename(tmp_path / "town.zip")
    (city / "deep" / "notes.txt").write_text("not empty, as the folder of a lost disk is")
    assert sorted(update(workspace, city).removed) == ["b", "dem"]
    assert not list((workspace.scene_folder("town") / "assets").glob(".*"))


def test_an_archive_beside_its_unpacked_files_is_read_once(tmp_path: Path) -> None:
    city = tmp_path / "city"
    path = write_citygml(city / "town.gml", "EPSG:25832", at(*MUNICH, "EPSG:25832"), side=1)
    with zipfile.ZipFile(city / "town.zip", "w") as archive:
        archive.write(path, "town.gml")
    with zipfile.ZipFile(city / "texts.zip", "w") as archive:
        archive.writestr("readme.txt", "nothing to read")
    done, _ = add(tmp_path, city)
    assert [Path(item.source) for item in done.imported] == [path]
    assert sorted((Path(file).relative_to(city).as_posix(), note.code) for file, note in done.ignored) == [
        ("texts.zip", "left-archive-without-files"),
        ("town.zip/town.gml", "left-same-content"),
    ]


def test_tiles_in_archives_are_one_terrain(tmp_path: Path) -> None:
    from affine import Affine

    city = tmp_path / "city"
    city.mkdir()
    for number in range(3):
        place = Affine(1, 0, WEST + 20 * number, 0, -1, NORTH)
        tile = write(tmp_path / f"dgm_{number}.tif", hills(20, 20) + number, transform=place)
        with zipfile.ZipFile(city / f"dgm_{number}.zip", "w") as archive:
            archive.write(tile, tile.name)
    done, _ = add(tmp_path, city)
    (terrain,) = done.imported
    assert (terrain.asset, terrain.report["rasters"]) == ("city", {"elevation": 3, "imagery": 0})
