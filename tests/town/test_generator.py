"""Determinism, resuming, errors, terrain and OBJ files of the generator."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio

from map3d_town import TownError, TownSpec, make_town
from tests.town.documents import BLDG, GML, TOWN, numbers, parse_files, rings_by_polygon


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_two_runs_write_the_same_bytes(town: Path, tmp_path: Path) -> None:
    make_town(tmp_path, TOWN, workers=2)
    assert content(tmp_path) == content(town)


def test_another_seed_gives_another_town(town: Path, tmp_path: Path) -> None:
    make_town(tmp_path, replace(TOWN, seed=5, formats=("obj",), terrain=False, trees=False))
    assert (tmp_path / "obj" / "b000003.obj").read_bytes() != (town / "obj" / "b000003.obj").read_bytes()


@pytest.mark.parametrize("deleted", ["citygml/buildings_001.gml", "terrain/dem.tif", "citygml/textures/plaster.jpg", "obj/b000002.obj"])
def test_only_the_deleted_file_is_written_again(town: Path, deleted: str) -> None:
    before, times = content(town), {p: p.stat().st_mtime_ns for p in town.rglob("*") if p.is_file()}
    (town / deleted).unlink()
    report = make_town(town, TOWN)
    assert report.written == 1
    assert content(town) == before
    touched = {str(p.relative_to(town)) for p, t in times.items() if p.stat().st_mtime_ns != t}
    assert touched == {deleted, "town.json"}


def test_truncated_file_is_written_again(town: Path) -> None:
    path = town / "obj" / "b000001.obj"
    whole = path.read_bytes()
    path.write_bytes(whole[:100])
    assert make_town(town, TOWN).written == 1
    assert path.read_bytes() == whole


def test_no_partial_files_remain(town: Path) -> None:
    assert not list(town.rglob("*.part"))


def test_town_json_lists_every_file(town: Path) -> None:
    listed = json.loads((town / "town.json").read_text())["files"]
    assert listed == {name: len(data) for name, data in content(town).items() if name != "town.json"}


def test_folder_of_another_town_raises(town: Path) -> None:
    with pytest.raises(TownError, match="other options"):
        make_town(town, replace(TOWN, seed=9))


def test_town_too_large_for_the_disk_raises_before_it_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda _: type("Usage", (), {"free": 1 << 20})())
    with pytest.raises(TownError, match="MiB are free"):
        make_town(tmp_path / "new", TOWN)
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    "wrong",
    [{"style": "gothic"}, {"buildings": 0}, {"files": 0}, {"files": 15}, {"formats": ()}, {"formats": ("dwg",)}, {"texture_px": 8}, {"crs": "UTM"}],
)
def test_invalid_option_raises_with_its_name(wrong: dict[str, object]) -> None:
    with pytest.raises(TownError, match=next(iter(wrong))):
        TownSpec(**{"buildings": 14, **wrong})  # type: ignore[arg-type]


def test_progress_counts_all_jobs(tmp_path: Path) -> None:
    calls: list[tuple[str, int, int]] = []
    spec = TownSpec(buildings=3, texture_px=128, terrain=False, trees=False)
    make_town(tmp_path, spec, lambda *call: calls.append(call))
    assert [done for _, done, _ in calls] == list(range(1, calls[0][2] + 1))


@pytest.mark.parametrize("count", [1, 14])
def test_number_of_buildings_is_exact(count: int, tmp_path: Path) -> None:
    spec = TownSpec(buildings=count, texture_px=128, terrain=False, trees=False)
    assert make_town(tmp_path, spec).buildings == count
    assert sum(len(list(root.iter(BLDG + "Building"))) for root in parse_files(tmp_path)) == count


def test_rough_estimate_is_within_a_factor_of_three(town: Path) -> None:
    size = sum(len(data) for data in content(town).values())
    assert 1 / 3 < TOWN.estimate().disk_bytes / size < 3


def test_rotterdam_class_is_a_valid_spec() -> None:
    spec = TownSpec(buildings=30_000, files=90, textures=26_474, texture_px=1024, ortho_px=65_536)
    estimate = spec.estimate()
    assert estimate.textures == 26_474
    assert estimate.ortho_side_px >= 65_536


def test_buildings_stand_on_the_terrain(town: Path) -> None:
    """Every ground polygon is slightly below the lowest terrain under its corners."""
    with rasterio.open(town / "terrain" / "dem.tif") as dem:
        assert dem.crs.to_epsg() == 25832
        assert dem.dtypes == ("float32",)
        for root in parse_files(town, "buildings_*.gml"):
            for surface in root.iter(BLDG + "GroundSurface"):
                ring = next(iter(next(iter(rings_by_polygon(surface).values())).values()))
                heights = np.array([v[0] for v in dem.sample(ring[:, :2].tolist())])
                assert -2.2 < ring[0, 2] - heights.min() < 0.1


def redness(picture: np.ndarray, ortho: rasterio.DatasetReader, points: np.ndarray) -> np.ndarray:
    """Returns red minus green of the orthophoto at points in the CRS."""
    column = ((points[:, 0] - ortho.bounds.left) / ortho.res[0]).astype(int)
    row = ((ortho.bounds.top - points[:, 1]) / ortho.res[1]).astype(int)
    return np.asarray(picture[0, row, column] - picture[1, row, column])


def test_the_orthophoto_shows_roofs_where_buildings_stand(town: Path) -> None:
    """Most points inside the footprints of houses are as red as tiles; 35 m to the north-east far fewer are."""
    inside = []
    for root in parse_files(town, "buildings_*.gml"):
        for building in root.iter(BLDG + "Building"):
            if "house" not in [value.text for value in building.iter("{http://www.opengis.net/citygml/generics/2.0}value")]:
                continue
            for surface in building.iter(BLDG + "GroundSurface"):
                ring = next(iter(next(iter(rings_by_polygon(surface).values())).values()))[:, :2]
                step = np.diff(ring, axis=0)
                right = np.stack([step[:, 1], -step[:, 0]], axis=1) / np.hypot(step[:, 0], step[:, 1])[:, None]
                middle = (ring[:-1] + ring[1:]) / 2
                inside.append(middle + 1.6 * right)
    with rasterio.open(town / "terrain" / "ortho.tif") as ortho, rasterio.open(town / "terrain" / "dem.tif") as dem:
        assert ortho.crs.to_epsg() == 25832
        assert ortho.profile["compress"] == "jpeg"
        assert ortho.profile["tiled"]
        assert np.allclose(ortho.bounds, dem.bounds)
        picture = ortho.read().astype(int)
        red_inside = (redness(picture, ortho, np.concatenate(inside)) > 30).mean()
        assert red_inside > 0.55
        moved = np.concatenate(inside) + np.array([25.0, 25.0])
        assert (redness(picture, ortho, moved) > 30).mean() < red_inside - 0.2


def test_trees_stand_on_the_terrain(town: Path) -> None:
    with rasterio.open(town / "terrain" / "dem.tif") as dem:
        for root in parse_files(town, "trees_*.gml"):
            points = np.concatenate([numbers(pos.text, 3) for pos in root.iter(GML + "pos")])
            heights = np.array([v[0] for v in dem.sample(points[:, :2].tolist())])
            assert np.abs(points[:, 2] - heights).max() < 1.2
            assert np.median(np.abs(points[:, 2] - heights)) < 0.1


def test_obj_and_citygml_of_a_building_have_the_same_extent(town: Path) -> None:
    root = parse_files(town, "buildings_000.gml")[0]
    building = root.find(f".//{BLDG}Building")
    assert building is not None
    expected = np.concatenate([r for rings in rings_by_polygon(building).values() for r in rings.values()])
    lines = (town / "obj" / "b000000.obj").read_text().splitlines()
    points = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
    assert np.allclose(points.min(axis=0), expected.min(axis=0))
    assert np.allclose(points.max(axis=0), expected.max(axis=0))


def test_obj_materials_and_textures_exist(town: Path) -> None:
    mtl = (town / "obj" / "town.mtl").read_text()
    names = {line.split()[1] for line in mtl.splitlines() if line.startswith("newmtl")}
    assert all((town / "obj" / line.split()[1]).is_file() for line in mtl.splitlines() if line.startswith("map_Kd"))
    for path in sorted((town / "obj").glob("*.obj")):
        lines = path.read_text().splitlines()
        assert {line.split()[1] for line in lines if line.startswith("usemtl")} <= names
        count = sum(line.startswith("v ") for line in lines)
        indices = [int(c.split("/")[0]) for line in lines if line.startswith("f ") for c in line.split()[1:]]
        assert min(indices) == 1
        assert max(indices) == count
