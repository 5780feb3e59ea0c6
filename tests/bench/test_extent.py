"""The extent benchmark on tiny towns: choice of blocks, sums, and a whole run."""

import json
from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is missing", exc_type=ImportError)

from bench.extent_programs import RUN_LENGTH, choose_blocks, sum_statistics

from bench import extent
from map3d.catalogue import PlannedJob
from map3d.tiles.naming import morton
from map3d.types import BlockId


def jobs(side: int) -> list[PlannedJob]:
    return [PlannedJob("0-45", BlockId(5, x, y), "base", morton(x, y), "key", None) for x in range(side) for y in range(side)]


def test_runs_of_neighbours_span_all_blocks() -> None:
    numbers = [morton(job.block.x, job.block.y) for job in choose_blocks(jobs(16), 40)]
    assert len(set(numbers)) == 40
    assert (numbers[0], numbers[-1]) == (0, 255)
    assert all(numbers[start + k] == numbers[start] + k for start in range(0, 40, RUN_LENGTH) for k in range(RUN_LENGTH))


def test_small_town_is_rendered_completely() -> None:
    assert {job.block for job in choose_blocks(jobs(4), 40)} == {job.block for job in jobs(4)}


def test_times_are_per_tile_and_counts_are_sums_over_workers() -> None:
    def answer(tiles: float, hits: int) -> dict:
        stats = {"visibility_s": 1.0, "shade_s": 2.0, "encode_s": 3.0, "traced_tiles": tiles}
        return {"wall_s": 2.0, "cpu_s": 1.0, "stats": stats, "scene": {"chunk_hits": hits}}

    total = sum_statistics([[answer(10, 5), answer(30, 9)], [answer(20, 7)]])
    assert (total["blocks"], total["tiles"], total["chunk_hits"], total["shade_s"]) == (3, 60, 16, 6.0)
    assert (total["wall_tile_ms"], total["cpu_tile_ms"]) == (100.0, 50.0)


@pytest.mark.whole
@pytest.mark.endurance
def test_extent_benchmark_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(extent, "BUILDINGS", 3)
    monkeypatch.setattr(extent, "RES_M", 0.5)
    small, large = extent.measure((0.001, 0.5), tmp_path / "extent", tmp_path / "plots", blocks=5)
    assert small["districts"] == 1
    assert large["districts"] > 1
    assert large["triangles"] == large["districts"] * small["triangles"]
    assert large["tiles"] > small["tiles"] > 0
    assert {path.name for path in (tmp_path / "plots").iterdir()} == {"extent-memory.svg", "extent-time.svg"}
    assert not (tmp_path / "extent" / "workspace").exists()
    assert len(json.loads((tmp_path / "extent" / "sizes.json").read_text())) == 2
    assert "| triangles, M |" in capfd.readouterr().out


def test_insufficient_disk_space_exits_before_it_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda _: type("Usage", (), {"free": 1 << 20})())
    with pytest.raises(SystemExit, match="are free"):
        extent.measure((1,), tmp_path)
    assert not list(tmp_path.iterdir())
