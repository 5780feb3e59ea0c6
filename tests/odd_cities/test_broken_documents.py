"""Documents that break off, wrong encodings, and files that must not be read: what can be had arrives, and the rest is said."""

import os
import socket
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.errors import UnknownFormat
from map3d.formats.detect import detect_format
from map3d.ingest.sources import find_sources, source_digest
from map3d.registry import Registry
from tests.cli.towns import Run, house
from tests.odd_cities.towns import HEAD, houses, write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)


def one_object(side: int) -> str:
    """Returns a city whose houses are one object, as in a terrain or an unstructured export."""
    faces = [face for _, faces in houses(side) for face in faces]
    polygons = "".join(
        "<gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>"
        + " ".join(f"{value:.3f}" for point in [*face, face[0]] for value in point)
        + "</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>\n"
        for face in faces
    )
    return (
        f'{HEAD}<core:cityObjectMember><bldg:Building gml:id="all"><bldg:lod1MultiSurface><gml:MultiSurface>{polygons}'
        "</gml:MultiSurface></bldg:lod1MultiSurface></bldg:Building></core:cityObjectMember></core:CityModel>\n"
    )


def test_a_cut_document_keeps_what_was_read(tmp_path: Path, run: Run) -> None:
    text = one_object(20)
    cut = text.find("</gml:posList>", text.find("\n", len(text) * 2 // 3))
    (tmp_path / "city").mkdir()
    (tmp_path / "city" / "town.gml").write_text(text[:cut])
    whole = text[:cut].count("</gml:Polygon>")
    assert 1000 < whole < 2400
    status, out, err = run("site", "city", "-o", "site", "--res", "1", "--view", "0-90", "--workers", "1", "--crs", "local")
    assert status == 0, err
    line = text[:cut].count("\n") + 1
    assert f"The file breaks off; what comes before is kept. Example: town: at byte {cut}, line {line} (the document ends inside " in out
    assert "elements)\n" in out
    catalogue = Workspace(tmp_path / "workspace").open_catalogue()
    (asset,) = catalogue.assets("city")
    catalogue.close()
    assert asset.report["triangles"] == 2 * whole


def test_letters_of_another_encoding_arrive(tmp_path: Path, run: Run) -> None:
    path = write_citygml(tmp_path / "town.gml", None, lambda corners: corners, prefix="Mühle-")
    path.write_bytes(path.read_text().encode("latin-1"))
    assert run("create-scene", "town")[0] == 0
    status, out, _ = run("add-files", "town", "town.gml", "--crs", "local")
    assert status == 0
    assert "The file is not in UTF-8 as it claims; other bytes are read as Windows-1252. Example: byte 349" in out
    with Registry(Workspace(tmp_path / "workspace").registry_path("town")) as registry:
        assert {item.name for item in registry.objects()} == {f"Mühle-{name}" for name, _ in houses()}


def test_what_is_not_a_stored_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.gml")
    with (tmp_path / "sparse.gml").open("wb") as file:
        file.write(HEAD.encode())
        file.truncate(50 << 30)
    with socket.socket(socket.AF_UNIX) as server:
        place = os.open(tmp_path, os.O_RDONLY)
        server.bind(f"/proc/self/fd/{place}/socket.gml")
        os.close(place)
        for name, text in (
            ("pipe.gml", "not a file but a named pipe"),
            ("socket.gml", "not a file but a socket"),
            ("sparse.gml", "a sparse file of 53,687,091,200 bytes, of which only "),
        ):
            with pytest.raises(UnknownFormat, match=f"{name}: {text}"):
                find_sources([tmp_path / name])
    with pytest.raises(UnknownFormat, match="/dev/zero: not a file but a device"):
        detect_format(Path("/dev/zero"))


def test_a_sparse_file_beside_a_document_is_not_hashed(tmp_path: Path) -> None:
    (tmp_path / "town.obj").write_text(house(0, 0, 6))
    (source,) = find_sources([tmp_path / "town.obj"])
    assert len(source_digest(source)) == 32
    with (tmp_path / "town.png").open("wb") as file:
        file.truncate(50 << 30)
    with pytest.raises(UnknownFormat, match=r"town\.png: a sparse file of 53,687,091,200 bytes"):
        source_digest(source)


def test_a_folder_with_pipes_and_sparse_files_becomes_a_site_of_the_others(tmp_path: Path, run: Run) -> None:
    city = tmp_path / "city"
    city.mkdir()
    (city / "town.obj").write_text(house(0, 0, 6))
    os.mkfifo(city / "pipe.gml")
    with (city / "sparse.gml").open("wb") as file:
        file.truncate(50 << 30)
    status, _, err = run("site", "city", "-o", "site", "--res", "1", "--view", "0-90", "--workers", "1", "--crs", "local")
    assert status == 3, err
    assert "a sparse file of 53,687,091,200 bytes" in err
    assert "pipe.gml: not a file but a named pipe\n" in err
