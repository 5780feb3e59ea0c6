"""The log lines of long operations."""

import io

from rich.console import Console

from map3d.cli.progress import LoggedProgress, line, show_stage


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
