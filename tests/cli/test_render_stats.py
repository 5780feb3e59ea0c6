"""map3d render --stats."""

import json
from pathlib import Path

import pytest

from map3d.cli.render_stats import print_summary, summary
from tests.cli.towns import Run, write_town

STAGES = {"visibility", "shade", "light", "reduce", "encode", "seam"}


def test_summary_without_rendered_blocks_is_zero() -> None:
    found = summary({})
    assert set(found["seconds"].values()) == {0.0}
    assert found["caches"]["chunk"] == {"hits": 0, "misses": 0, "hit_rate": None}


def test_hit_rate_is_hits_per_request(capsys: pytest.CaptureFixture[str]) -> None:
    found = summary({"shade_s": 3.0, "encode_s": 1.0, "chunk_hits": 30, "chunk_misses": 10, "texture_hits": 1})
    assert found["seconds"]["shade"] == 3.0
    assert found["caches"]["chunk"]["hit_rate"] == 0.75
    assert found["caches"]["texture"]["hit_rate"] == 1.0
    print_summary(found)
    text = capsys.readouterr().out
    assert "75.00 %" in text
    assert "75 %" in text


@pytest.mark.whole
def test_render_prints_stages_and_caches(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
    run("create-scene", "town")
    assert run("add-files", "town", str(write_town(tmp_path / "files")))[0] == 0
    assert run("create-rendering", "town", "view", "--res", "0.05", "--view", "0/45")[0] == 0
    status, out, err = run("render", "view", "--json", "--stats")
    assert status == 0, err
    stats = json.loads(out)["stats"]
    assert set(stats["seconds"]) == STAGES
    assert all(seconds > 0 for stage, seconds in stats["seconds"].items() if stage != "light")
    assert stats["seconds"]["light"] == 0
    assert 0 < stats["caches"]["chunk"]["hit_rate"] < 1
    status, out, _ = run("render", "view", "--stats")
    assert status == 0
    assert "visibility" in out
    assert json.loads(run("render", "view", "--json")[1])["stats"] is None
    assert run("add-layers", "view", "--layers", "sun", "--sun", "200,40")[0] == 0
    assert json.loads(run("render", "view", "--json", "--stats")[1])["stats"]["seconds"]["light"] > 0
