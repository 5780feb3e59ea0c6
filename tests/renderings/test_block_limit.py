"""Pyramids that planning cannot hold are refused; the estimate is checked against blocks that are counted."""

import re
from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.cli.app import run
from map3d.errors import BadRequest
from map3d.geometry.core_frame import core_frame
from map3d.geometry.frames import pin
from map3d.renderings import block_limit
from map3d.renderings.block_limit import MOST_BASE_BLOCKS, check_block_count, estimate_blocks
from map3d.tiles.naming import block_levels
from map3d.types import ViewAngles
from tests.core.built import build_houses


@pytest.mark.parametrize("counted", [1 << 6, 1 << 8])
def test_estimate_is_near_the_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, counted: int) -> None:
    scene = build_houses(tmp_path, [(0.0, 0.0, 100.0, 6.0)])
    monkeypatch.setattr(block_limit, "MOST_BASE_BLOCKS", 1 << 8)
    monkeypatch.setattr(block_limit, "_COUNTED", counted)
    for view in (ViewAngles(0, 90), ViewAngles(30, 35)):
        (frame,) = pin(scene.box, 256, 0.0008, [view])
        root = block_levels(frame.zmax)[0].root
        assert root > 5
        count = len(scene.occupied(core_frame(frame.to_json()), root))
        assert count <= estimate_blocks(scene, frame) < 2 * count, "coarse tiles at the edges are partly empty"


def test_few_blocks_are_counted_at_any_depth(tmp_path: Path) -> None:
    """Two houses of 2 mm at the ends of 10 km, 24 levels deep."""
    scene = build_houses(tmp_path, [(0.0, 0.0, 0.002, 6.0), (7000.0, 7000.0, 0.002, 6.0)])
    (frame,) = pin(scene.box, 256, 0.00001, [ViewAngles(0, 90)])
    root = block_levels(frame.zmax)[0].root
    assert 4**root > MOST_BASE_BLOCKS
    assert estimate_blocks(scene, frame) == len(scene.occupied(core_frame(frame.to_json()), root)) <= 18
    check_block_count(scene, [frame], "r")


def test_named_levels_are_the_most_that_are_allowed(tmp_path: Path) -> None:
    scene = build_houses(tmp_path, [(0.0, 0.0, 0.05, 0.05)])
    (frame,) = pin(scene.box, 256, 0.05 / 256 / 2**19, [ViewAngles(0, 90)])
    with pytest.raises(
        BadRequest, match=r"rendering r: view 0-90 would have about [\d,]+ base blocks in 2\d levels, the limit is 67,108,864"
    ) as caught:
        check_block_count(scene, [frame], "r")
    levels = int(re.search(r"at most (\d+) levels", str(caught.value))[1])
    res_m = float(re.search(r"that is (\S+) m per pixel", str(caught.value))[1])
    (allowed,) = pin(scene.box, 256, res_m, [ViewAngles(0, 90)])
    assert allowed.zmax + 1 in (levels, levels + 1), "the resolution is rounded"
    (fits,) = pin(scene.box, 256, res_m * 1.01, [ViewAngles(0, 90)])
    assert fits.zmax + 1 == levels
    check_block_count(scene, [fits], "r")


def test_21_levels_of_centimetres_are_refused_by_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "small.obj").write_text("v 0 0 0\nv 0.05 0 0\nv 0 0.05 0\no a\nf 1 2 3\n")
    where = ["-w", str(tmp_path / "workspace")]
    for command in (
        ["create-scene", "town", "--crs", "local", "--ground-plane", "off", *where],
        ["add-files", "town", str(tmp_path / "small.obj"), *where],
    ):
        assert run(command) == 0
    create = ["create-rendering", "town", "r", "--view", "0-90", "--layers", "color,id", *where]
    assert run([*create, "--levels", "21"]) == 2
    assert "base blocks in 21 levels, the limit is 67,108,864; use at most" in capsys.readouterr().err
    assert run([*create, "--levels", "5"]) == 0
