"""The log lines of long operations."""

import io

import pytest
from rich.console import Console

from map3d.catalogue import JobResult, Lease, PlanCounts, State
from map3d.cli import progress
from map3d.cli.progress import LoggedProgress, line, show_stage
from map3d.cli.run_progress import RunProgress
from map3d.jobs.events import JobDone, JobFailed, Planned, Remaining, SceneChanged
from map3d.messages import verbatim
from map3d.types import BlockId


def test_line_shows_count_rate_and_remaining_time() -> None:
    shown = io.StringIO()
    with LoggedProgress(Console(file=shown, width=200), every_s=0.0) as bar:
        task = bar.add_task("rendering", total=120, rate="10 base tiles/s")
        bar.tasks[0].start_time = bar.get_time() - 20
        bar.update(task, advance=40)
    text = shown.getvalue()
    assert text.startswith("rendering: 40 of 120, 2.0/s, 40 s left, 10 base tiles/s")
    assert text.count("\n") == 1


def test_short_operation_prints_no_line() -> None:
    shown = io.StringIO()
    with LoggedProgress(Console(file=shown)) as bar:
        bar.update(bar.add_task("planning", total=3), completed=3)
    assert shown.getvalue() == ""


def test_task_without_count_shows_elapsed_time() -> None:
    bar = LoggedProgress(Console(file=io.StringIO()))
    bar.add_task("1 of 3: town.gml", total=None)
    bar.tasks[0].start_time = bar.get_time() - 75
    assert line(bar.tasks[0]) == "1 of 3: town.gml: 75 s"


def test_each_stage_has_its_own_rate() -> None:
    shown = io.StringIO()
    with LoggedProgress(Console(file=shown, width=200), every_s=0.0) as bar:
        task = bar.add_task("building", total=None)
        show_stage(bar, task, "textures", 10, 10)
        bar.tasks[0].start_time = bar.get_time() - 600
        show_stage(bar, task, "textures", 10, 10)
        show_stage(bar, task, "chunks", 1, 4)
        bar.tasks[0].start_time = bar.get_time() - 2
        show_stage(bar, task, "chunks", 2, 4)
    assert shown.getvalue().splitlines()[-1] == "chunks: 2 of 4, 1.0/s, 2 s left"


def test_bar_of_a_run_counts_again_after_a_new_plan_and_follows_other_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = io.StringIO()
    monkeypatch.setattr(progress, "console", lambda: Console(file=shown, width=200))
    monkeypatch.setattr(progress, "LINE_EVERY_S", 0.0)
    lease = Lease("r", "0-45", BlockId(3, 1, 2), "base", "k", 1, 1, "w", 1)
    with RunProgress() as run:
        run(Planned(PlanCounts(10, 0, 0), 10))
        run(JobDone(lease, JobResult(1, False, base_tiles=4)))
        assert run.counted == (1, 10)
        run(Remaining(6))
        assert run.counted == (4, 10), "another run has done three jobs"
        run(SceneChanged(lease, "rebuilt"))
        run(Planned(PlanCounts(2, 3, 5), 25))
        assert run.counted == (0, 25)
        run(Remaining(30))
        assert run.counted == (0, 30), "another run has planned more"
        run(JobFailed(lease, verbatim("it fell"), State.TODO))
    lines = shown.getvalue()
    assert "blocks: 2 new, 3 changed, 5 unchanged; 25 to render" in lines
    assert "files changed during the render" in lines
    assert "0-45 3/1/2: attempt 1 failed (it fell); the block is now todo" in lines
