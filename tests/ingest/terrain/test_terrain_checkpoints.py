"""Terrain is the same whatever the number of threads, and an import that was killed resumes with its finished checkpoints."""

import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from pyproj import CRS

pytest.importorskip("map3d._core", reason="the compiled core is not built")

from map3d.catalogue import SceneRecord, Workspace
from map3d.ingest.import_checkpoints import checkpoints_key, import_checkpoints
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.import_progress import ImportProgress
from map3d.ingest.importing import import_file
from map3d.ingest.sources import find_sources
from map3d.ingest.terrain import terrain_checkpoints
from map3d.ingest.terrain.parse_terrain import worker_count
from map3d.ingest.terrain.terrain_import import import_terrain
from map3d.ingest.terrain.terrain_options import TerrainOptions
from map3d.ingest.terrain.terrain_tiles import TileBuilder
from tests.ingest.terrain.rasters import colours, hills, write

UTM = CRS.from_epsg(25832)
TILES = 7 * 7
KILLED = """
import os, sys
from pathlib import Path
from tests.ingest.terrain import test_terrain_checkpoints as test
from map3d.ingest.terrain import terrain_checkpoints

original, left = terrain_checkpoints._write_checkpoint, [int(sys.argv[2])]

def kill(*arguments):
    left[0] -= 1
    if left[0] < 0:
        os.kill(os.getpid(), 9)
    return original(*arguments)

terrain_checkpoints._write_checkpoint = kill
test.run(Path(sys.argv[1]), "killed", workers=2, checkpoints=Path(sys.argv[1], "checkpoints"))
"""


def run(folder: Path, name: str, checkpoints: Path | None = None, **options: object) -> dict[str, bytes]:
    """Imports the rasters of `folder`; returns the asset's files."""
    terrain = TerrainOptions(tile_cells=16, **options)  # type: ignore[arg-type]
    import_terrain(folder / "dem.tif", folder / "ortho.tif", folder / name, UTM, terrain, checkpoints=checkpoints)
    return read_files(folder / name)


def read_files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def rasters(tmp_path: Path) -> Path:
    write(tmp_path / "dem.tif", hills(100, 100), 2.0)
    write(tmp_path / "ortho.tif", colours(300, 400), 0.5)
    return tmp_path


@pytest.mark.parametrize("error", [0.0, 0.4])
def test_the_asset_does_not_depend_on_the_number_of_threads(rasters: Path, error: float) -> None:
    one, two, many = (run(rasters, f"w{workers}", workers=workers, max_error_m=error) for workers in (1, 2, 7))
    assert one == two == many
    assert set(one) > {"mesh.m3a", "materials.json", "objects.jsonl", "report.json"}


def test_checkpoints_of_several_tiles_give_the_same_asset(rasters: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = run(rasters, "single")
    monkeypatch.setattr(terrain_checkpoints, "CHECKPOINTS", 10)
    assert run(rasters, "several", checkpoints=rasters / "checkpoints", workers=2) == expected
    assert len(list((rasters / "checkpoints").glob("*.zip"))) == 10


@pytest.mark.parametrize("finished", [0, 20])
def test_a_killed_import_resumes_from_its_checkpoints(rasters: Path, monkeypatch: pytest.MonkeyPatch, finished: int) -> None:
    expected = run(rasters, "undisturbed")
    command = [sys.executable, "-c", KILLED, str(rasters), str(finished)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    assert subprocess.run(command, check=False, env=environment, timeout=60).returncode == -signal.SIGKILL
    checkpoints = rasters / "checkpoints"
    there = len(list(checkpoints.glob("*.zip")))
    assert finished - 1 <= there <= finished, "with two threads, one checkpoint may be unfinished"
    built = count_tiles(monkeypatch)
    assert run(rasters, "resumed", checkpoints, workers=2) == expected
    assert len(built) == TILES - there


def count_tiles(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Returns a list to which each tile that is built is added."""
    original, built = TileBuilder.build, []

    def build(*arguments: object) -> object:
        built.append(arguments[1])
        return original(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(TileBuilder, "build", build)
    return built


def test_a_damaged_checkpoint_and_one_without_its_texture_are_built_again(rasters: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    checkpoints = rasters / "checkpoints"
    expected = run(rasters, "undisturbed", checkpoints)
    os.truncate(checkpoints / "3.zip", 100)
    checkpoint = terrain_checkpoints.TerrainCheckpoint.read(checkpoints / "10.zip")
    assert checkpoint is not None
    ((name, size),) = checkpoint.textures()
    (checkpoints / "textures" / name).unlink()
    (checkpoints / "textures" / name).write_bytes(b"x" * (size - 1))
    built = count_tiles(monkeypatch)
    assert run(rasters, "repaired", checkpoints) == expected
    assert len(built) == 2


def test_an_error_in_a_thread_ends_the_import_and_leaves_finished_checkpoints(rasters: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected, original = run(rasters, "undisturbed"), TileBuilder.build

    def fail(self: TileBuilder, tile: object, *arguments: object) -> object:
        if (tile.row, tile.column) == (3, 3):  # type: ignore[attr-defined]
            raise OSError("the disk is full")
        return original(self, tile, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(TileBuilder, "build", fail)
    with pytest.raises(OSError, match="the disk is full"):
        run(rasters, "failed", rasters / "checkpoints", workers=2)
    monkeypatch.setattr(TileBuilder, "build", original)
    built = count_tiles(monkeypatch)
    assert run(rasters, "resumed", rasters / "checkpoints") == expected
    assert 0 < len(built) <= TILES - 3 * 7 - 3


def interrupted(asset: Path, inputs: str) -> tuple[Path, set[str]]:
    """Returns the folder of an import that stops after its first checkpoint, and what was in it before."""
    with suppress(KeyboardInterrupt), import_checkpoints(asset, checkpoints_key({"files": inputs})) as folder:
        assert folder is not None
        there = {path.name for path in folder.glob("*.zip")}
        (folder / "0.zip").write_bytes(b"checkpoint")
        raise KeyboardInterrupt
    return folder, there


def test_checkpoints_of_other_inputs_are_removed(tmp_path: Path) -> None:
    asset = tmp_path / "terrain"
    assert interrupted(asset, "a")[1] == set()
    folder, there = interrupted(asset, "a")
    assert there == {"0.zip"}
    with import_checkpoints(tmp_path / "other", checkpoints_key({})) as other:
        assert folder.exists()
        with import_checkpoints(tmp_path / "other", checkpoints_key({})) as locked:
            assert locked is None, "another import uses it"
        assert other is not None
        assert other.exists()
    with import_checkpoints(asset, checkpoints_key({"files": "b"})) as new:
        assert new is not None
        assert not folder.exists()
    assert list(tmp_path.iterdir()) == []


KILLED_IMPORT = """
import os, sys
from pathlib import Path
from map3d.ingest.import_progress import ImportProgress
from tests.ingest.terrain import test_terrain_checkpoints as test

def kill(self, counts):
    if counts["done"] >= 5:
        os.kill(os.getpid(), 9)

ImportProgress.message = kill
test.import_into(Path(sys.argv[1]), Path(sys.argv[2]))
"""


def import_into(root: Path, folder: Path) -> Path:
    """Imports the rasters of a folder into the scene of a workspace; returns the folder of its assets."""
    workspace = Workspace(root).create()
    catalogue = workspace.open_catalogue()
    if not catalogue.scenes():
        catalogue.create_scene(SceneRecord("town"))
    import_file(workspace, catalogue, "town", find_sources([folder / "dem.tif", folder / "ortho.tif"])[0], ImportOptions(), lambda _: None)
    catalogue.close()
    return workspace.scene_folder("town") / "assets"


def test_an_import_into_a_scene_resumes_after_it_was_killed(tmp_path: Path) -> None:
    write(tmp_path / "dem.tif", hills(200, 200), 10.0)
    write(tmp_path / "ortho.tif", colours(4000, 4000), 0.5)
    # In the same place, because reports know their workspace.
    root = tmp_path / "workspace"
    expected = read_files(import_into(root, tmp_path))
    shutil.rmtree(root)
    command = [sys.executable, "-c", KILLED_IMPORT, str(root), str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    assert subprocess.run(command, check=False, env=environment, timeout=120).returncode == -signal.SIGKILL
    assert len(list((root / "scenes" / "town" / "assets").glob(".dem.*.pieces/*.zip"))) >= 5
    assets = import_into(root, tmp_path)
    assert read_files(assets) == expected
    assert [path.name for path in assets.iterdir()] == ["dem"]


@pytest.mark.parametrize(
    ("cores", "free_mb", "photo", "expected"),
    [(1, 4000, "uint8", 1), (4, 4000, "uint8", 4), (4, 500, "uint8", 2), (4, 100, "uint8", 1), (4, 1000, "uint16", 2), (1000, 1e9, "uint8", 256)],
)
def test_threads_are_as_many_as_cores_and_memory_allow(tmp_path: Path, cores: int, free_mb: float, photo: str, expected: int) -> None:
    path = write(tmp_path / "ortho.tif", colours(4, 4).astype(photo))
    assert worker_count(cores, free_mb * 2**20, 2048, [path]) == expected


def test_progress_says_rate_and_remaining_time(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter((0.0, 1.0, 2.0, 63.0))
    monkeypatch.setattr("time.monotonic", lambda: next(clock))
    progress = ImportProgress()
    assert str(progress.message({"done": 1000, "total": 5000})) == "1,000 of 5,000 tiles"
    assert str(progress.message({"done": 1010, "total": 5000})) == "1,010 of 5,000 tiles, 10/s, 7 min left"
    assert str(progress.message({"done": 1020, "total": 5000})) == "1,020 of 5,000 tiles, 10/s, 7 min left"
    assert str(progress.message({"done": 1081, "total": 5000})) == "1,081 of 5,000 tiles, 1/s, 65 min left"
    assert str(progress.message({"triangles": 50_000})) == "50,000 triangles"
