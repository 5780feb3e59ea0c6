"""A short version of `make faults`; the long one runs for two hours."""

from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from tests.faults.disk_full import can_mount, run_disk_full
from tests.faults.kills import run_kills
from tests.faults.system_calls import is_strace_usable, run_system_calls


@pytest.mark.endurance
def test_killed_processes_lose_no_tile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))  # a server that is killed leaves its temporary files
    (report,) = run_kills(runs=1, kills=8, seed=20, houses=24)
    assert report.kills.total() >= 8
    assert report.faults == []


@pytest.mark.skipif(not is_strace_usable(), reason="strace is not installed or may not trace processes; apt install strace")
def test_failing_system_calls_leave_nothing_half_committed() -> None:
    report = run_system_calls(every=75)
    assert report.outcomes.total() > 4
    assert report.faults == []


@pytest.mark.skipif(not can_mount(), reason="only root may mount a small disk")
def test_render_on_a_full_disk_ends_clearly_and_resumes() -> None:
    report = run_disk_full(sizes=2)
    assert report.failed > 0
    assert report.faults == []
