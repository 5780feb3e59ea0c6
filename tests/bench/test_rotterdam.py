"""The Rotterdam benchmark on a tiny city: it completes, resumes after a failure, cleans up, and measures all processes."""

import json
import os
import sys
from pathlib import Path

import pytest
from bench.resource_monitor import ResourceUsage, disk_bytes_of, process_tree, run_monitored

from bench import rotterdam

pytest.importorskip("map3d._core", reason="the compiled core is missing", exc_type=ImportError)
pytestmark = [pytest.mark.whole, pytest.mark.skipif(not Path("/proc/self/stat").is_file(), reason="needs /proc")]

SCALE = 5000
GREEDY = (
    "import subprocess, sys; a = bytearray(64 << 20); subprocess.run([sys.executable, '-c', 'import time; b = bytearray(64 << 20); time.sleep(1)'])"
)


def main(monkeypatch: pytest.MonkeyPatch, folder: Path, *options: str) -> None:
    monkeypatch.setattr(sys, "argv", ["bench", "--scale", str(SCALE), "--folder", str(folder), *options])
    rotterdam.main()


@pytest.mark.endurance
def test_tiny_city_completes_all_stages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    main(monkeypatch, tmp_path)
    record = json.loads((tmp_path / "figures.json").read_text())
    assert list(record["stages"]) == ["make-town", "create-scene", "add-files", "create-rendering", "render", "publish"]
    assert all(row["wall_s"] > 0 and row["cpu_s"] > 0 and row["memory_bytes"] > 1 << 20 for row in record["stages"].values())
    assert record["facts"]["base_filled"] >= 0.9
    assert max(row["disk_peak_bytes"] for row in record["stages"].values()) < record["disk_needed_bytes"]
    assert {path.name for path in tmp_path.iterdir()} == {"figures.json", "table.md", "town.json"}
    assert "| all |" in capfd.readouterr().out


@pytest.mark.endurance
def test_failed_run_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = rotterdam.view_options
    monkeypatch.setattr(rotterdam, "view_options", lambda size: [*words(size), "--nonsense"])
    with pytest.raises(SystemExit, match="create-rendering failed"):
        main(monkeypatch, tmp_path)
    before = json.loads((tmp_path / "figures.json").read_text())
    monkeypatch.setattr(rotterdam, "view_options", words)
    main(monkeypatch, tmp_path, "--keep")
    after = json.loads((tmp_path / "figures.json").read_text())
    assert after["stages"]["add-files"] == before["stages"]["add-files"]
    assert after["stages"]["create-rendering"]["runs"] == 2
    assert (tmp_path / "published" / "rendering.json").is_file()


def test_insufficient_disk_space_exits_before_it_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda _: type("Usage", (), {"free": 1 << 20})())
    with pytest.raises(SystemExit, match="are free"):
        main(monkeypatch, tmp_path)
    assert not list(tmp_path.iterdir())


def test_memory_includes_child_processes(tmp_path: Path) -> None:
    figures = ResourceUsage()
    assert run_monitored([sys.executable, "-c", GREEDY], tmp_path, figures) == 0
    assert figures.memory_bytes > 128 << 20
    assert figures.cpu_s > 0
    assert figures.runs == 1


def test_process_tree_contains_descendants() -> None:
    own = process_tree(os.getpid())
    assert own[0] == os.getpid()
    assert len(own) == len(set(own))
    assert os.getpid() in process_tree(os.getppid())


def test_links_do_not_count_twice(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(bytes(100_000))
    once = disk_bytes_of(tmp_path)
    (tmp_path / "b").symlink_to(tmp_path)
    assert once <= disk_bytes_of(tmp_path) < once + 8192
