"""Models that name no coordinate system lie where files beside them, or the user, say; advice in a message works when it is followed."""

from pathlib import Path

import numpy as np
import pytest

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import FilesImport, import_files
from map3d.ingest.import_options import ImportOptions
from map3d.requests.reading import ModelOffset
from tests.cli.towns import Run, house
from tests.findings import warned
from tests.ingest.terrain.rasters import NORTH, WEST, hills, write
from tests.odd_cities.towns import world_boxes

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

PRJ = 'PROJCS["ETRS89 / UTM zone 32N",AUTHORITY["EPSG","25832"]]'
AT = ModelOffset(WEST + 5.0, NORTH - 15.0, 500.0)
BOX = ((AT.east, AT.north, 500.0), (AT.east + 8.0, AT.north + 10.0, 506.0))


def add(tmp_path: Path, folder: Path, **options: object) -> tuple[FilesImport, dict[str, object]]:
    """Imports a folder; returns what was done, and the boxes of what is drawn."""
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    done = import_files(workspace, catalogue, "town", [folder], ImportOptions(**options))  # type: ignore[arg-type]
    catalogue.close()
    return done, dict(world_boxes(workspace, "town"))


def write_model(folder: Path, scale: float = 1.0, **files: str) -> Path:
    folder.mkdir()
    lines = house(0.0, 0.0, 6.0).splitlines()
    scaled = [f"v {' '.join(str(float(value) * scale) for value in line.split()[1:])}" if line.startswith("v ") else line for line in lines]
    (folder / "house.obj").write_text("\n".join(scaled) + "\n")
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(text)
    return folder


def codes(done: FilesImport) -> list[str]:
    return [item["code"] for one in done.imported for item in warned(one.report)]


def test_a_model_lies_where_its_offset_says_and_the_terrain_fits(tmp_path: Path) -> None:
    offset = f"{AT.east} {AT.north} {AT.height}\n"
    city = write_model(tmp_path / "city", house_offset__xyz=offset, house_wkt__prj=PRJ)
    write(city / "dem.tif", hills(40, 40) + 500.0)
    done, boxes = add(tmp_path, city)
    assert (done.failed, codes(done)) == ([], ["model-placed"])
    assert np.allclose(boxes["house"], BOX, atol=1e-3)  # type: ignore[arg-type]
    used = {Path(file).name: note.code for file, note in done.ignored}
    assert used == {"house_offset.xyz": "used-as-place", "house_wkt.prj": "used-beside"}


@pytest.mark.parametrize(("unit", "scale"), [("cm", 100.0), ("mm", 1000.0), ("ft", 1 / 0.3048), ("us-ft", 3937 / 1200), ("in", 1 / 0.0254)])
def test_the_user_says_unit_and_place(tmp_path: Path, unit: str, scale: float) -> None:
    done, boxes = add(tmp_path, write_model(tmp_path / "city", scale), crs="EPSG:25832", offset=AT, unit=unit)
    assert (done.failed, codes(done)) == ([], [])
    (box,) = boxes.values()
    assert np.allclose(box, BOX, atol=1e-3)  # type: ignore[arg-type]


def test_the_user_counts_before_files(tmp_path: Path) -> None:
    city = write_model(tmp_path / "city", house_offset__xyz="1 2 3", house_wkt__prj=PRJ)
    _, boxes = add(tmp_path / "a", city, offset=AT)
    (box,) = boxes.values()
    assert np.allclose(box, BOX, atol=1e-3)  # type: ignore[arg-type]
    done, boxes = add(tmp_path / "b", city, crs="local")
    (box,) = boxes.values()
    assert (np.allclose(box, ((0, 0, 0), (8, 10, 6)), atol=1e-3), codes(done)) == (True, [])  # type: ignore[arg-type]


def test_a_system_alone_does_not_put_a_model_at_its_origin(tmp_path: Path) -> None:
    done, boxes = add(tmp_path, write_model(tmp_path / "city", house__prj=PRJ))
    (box,) = boxes.values()
    assert (np.allclose(box, ((0, 0, 0), (8, 10, 6)), atol=1e-3), codes(done)) == (True, ["model-without-place"])  # type: ignore[arg-type]


def test_the_advice_about_rasters_far_from_a_model_works(tmp_path: Path, run: Run) -> None:
    city = write_model(tmp_path / "city")
    write(city / "dem.tif", hills(40, 40) + 500.0)
    status, _, err = run("inspect", "city")
    assert status == 1
    assert "if models have an origin of their own, say where it lies with --crs EPSG:25832 --offset X,Y,Z" in err
    status, out, err = run("inspect", "city", "--crs", "EPSG:25832", "--offset", f"{AT.east},{AT.north},{AT.height}")
    assert (status, err) == (0, "")
    assert "extent       40 m × 40 m" in out
    assert "outside the area" not in out
    status, _, err = run("inspect", "city", "--offset", "1,2")
    assert (status, "is not X,Y,Z; write X,Y,Z, e.g. 691000,5336000,500" in err) == (2, True)
