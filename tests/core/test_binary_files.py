"""The core reads and checks the binary files of a scene."""

from pathlib import Path

import numpy as np
import pytest

from map3d import _core
from map3d.types import LAYER_KINDS
from tests.core.built import build_houses

HOUSES = [(0.0, 0.0, 10.0, 6.0), (20.0, 0.0, 8.0, 4.0)]
SUNS = {"sun": 1, "sun16": 3, "picture": 1}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("houses")
    build_houses(path, HOUSES)
    return path


def binary_files(folder: Path) -> list[Path]:
    return sorted([*folder.glob("assets/*/mesh.m3a"), *folder.glob("chunks/*.m3c")])


def test_a_damaged_file_is_refused(folder: Path, tmp_path: Path) -> None:
    files = binary_files(folder)
    assert len(files) == 2
    for path in files:
        _core.check_file(str(path))
        data = path.read_bytes()
        for damaged in (b"", data[:50], data[:-1], b"NOPE" + data[4:], data[:4] + b"\2" + data[5:], data[:200] + bytes([data[200] ^ 4]) + data[201:]):
            (tmp_path / path.name).write_bytes(damaged)
            with pytest.raises(_core.FormatError, match=path.name):
                _core.check_file(str(tmp_path / path.name))
    with pytest.raises(_core.StorageError):
        _core.check_file(str(tmp_path / "missing"))


def test_a_mesh_has_the_arrays_of_its_asset(folder: Path) -> None:
    mesh = _core.AssetMesh(str(folder / "assets" / "houses" / "mesh.m3a"))
    assert (mesh.positions.shape, mesh.triangles.shape, mesh.uvs.shape) == ((16, 3), (20, 3), (20, 3, 2))
    assert mesh.objects.tolist() == [0] * 10 + [1] * 10
    assert not mesh.materials.any()
    assert not mesh.prototypes.any()
    assert mesh.positions[mesh.triangles[mesh.objects == 1]].reshape(-1, 3).min(axis=0).tolist() == [20.0, 0.0, 0.0]


def test_boxes_of_a_mesh_are_those_of_its_objects(folder: Path) -> None:
    mesh = _core.AssetMesh(str(folder / "assets" / "houses" / "mesh.m3a"))
    assert mesh.boxes(3) == ([((0.0, 0.0, 0.0), (10.0, 10.0, 6.0)), ((20.0, 0.0, 0.0), (28.0, 8.0, 4.0)), None], {}, [0, 0, 0])
    with pytest.raises(_core.FormatError, match="object 1"):
        mesh.boxes(1)


def test_a_scene_has_the_box_of_each_object(folder: Path) -> None:
    scene = _core.Scene(str(folder))
    assert scene.object_box(1) == ((0.0, 0.0, 0.0), (10.0, 10.0, 6.0))
    assert scene.object_box(2) == ((20.0, 0.0, 0.0), (28.0, 8.0, 4.0))
    assert scene.object_box(3) is None


def frame(kinds: tuple[str, ...], tile_px: int = 256) -> _core.Frame:
    layers = [
        _core.LayerSpec(
            kind, "m3d" if kind == "data" else "png", suns=[(0.0, 0.0, 1.0)] * SUNS.get(kind, 0), radius_m=5.0 if kind in ("ao", "picture") else 0.0
        )  # type: ignore[arg-type]
        for kind in kinds
    ]
    return _core.Frame(0.0, 90.0, -16.0, 40.0, -1000.0, 64.0, tile_px, 1, layers)


def list_arrays(kinds: tuple[str, ...]) -> set[str]:
    """Returns the arrays of a pass of these layers; a data tile holds three kinds."""
    return {"id", "depth"} | {array for kind in kinds for array in (("normal",) if kind == "data" else (kind,))}


@pytest.mark.parametrize(
    "kinds",
    [("color", "normal", "id", "depth"), ("normal",), ("color", "data"), ("sun",), ("sun16", "ao"), ("depth2",), ("picture", "color"), ("id",)],
)
def test_a_seam_is_valid_for_passes_of_its_arrays_alone(folder: Path, kinds: tuple[str, ...]) -> None:
    seam = _core.Scene(str(folder)).render_block(frame(kinds), 0, 0, 0).seam
    assert seam is not None
    arrays = list_arrays(kinds)
    for other in [(kind,) for kind in LAYER_KINDS] + [kinds, ("color", "normal")]:
        if list_arrays(other) == arrays:
            _core.check_seam(frame(other), seam)
        else:
            with pytest.raises(_core.FormatError, match="arrays"):
                _core.check_seam(frame(other), seam)
    with pytest.raises(_core.FormatError, match="expected 512"):
        _core.check_seam(frame(kinds, 512), seam)


def test_a_damaged_seam_is_refused(folder: Path) -> None:
    kinds = ("normal",)
    seam = _core.Scene(str(folder)).render_block(frame(kinds), 0, 0, 0).seam
    assert seam is not None
    for at in np.linspace(0, len(seam) - 1, 40, dtype=int).tolist():
        with pytest.raises(_core.FormatError):
            _core.check_seam(frame(kinds), seam[:at] + bytes([seam[at] ^ 1]) + seam[at + 1 :])
    for broken in (b"", seam[:20], seam[:-1], seam + b"x"):
        with pytest.raises(_core.FormatError):
            _core.check_seam(frame(kinds), broken)
