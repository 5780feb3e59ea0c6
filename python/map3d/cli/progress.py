"""Progress of long operations: a bar on a terminal, an occasional line in a log."""

import time
from typing import Any, Final

from rich.console import Console
from rich.progress import Progress, ProgressColumn, Task, TaskID

from map3d.cli.output import console, time_text

LINE_EVERY_S: Final = 20.0


def progress_bar(*columns: ProgressColumn) -> Progress:
    """Returns a progress display on standard error: a bar that disappears at the end, or in a log one line every `LINE_EVERY_S`."""
    shown = console()
    return Progress(*columns, console=shown, transient=True) if shown.is_terminal else LoggedProgress(shown)


def show_stage(bar: Progress, task_id: TaskID, stage: str, done: int, total: int | None) -> None:
    """Shows the progress of one stage. Each stage restarts the clock, so that rate and remaining time are those of the stage."""
    if bar.tasks[bar.task_ids.index(task_id)].description != stage:
        bar.reset(task_id, description=stage)
    bar.update(task_id, completed=done, total=total)


class LoggedProgress(Progress):
    """Prints lines such as `rendering: 40 of 120, 1.3/s, 62 s left, 10 base tiles/s` instead of drawing a bar."""

    def __init__(self, shown: Console, every_s: float = LINE_EVERY_S) -> None:
        super().__init__(console=shown, disable=True)
        self._every_s = every_s
        self._last_s = time.monotonic()

    def update(self, task_id: TaskID, **changes: Any) -> None:
        super().update(task_id, **changes)
        now = time.monotonic()
        if now - self._last_s >= self._every_s:
            self._last_s = now
            self.console.print(line(self.tasks[self.task_ids.index(task_id)]))


def line(task: Task) -> str:
    """Returns the progress of a task as text: count, total, rate and remaining time as far as they are known, and its fields."""
    done = f"{task.completed:,.0f} of {task.total:,.0f}" if task.total else f"{task.completed:,.0f}"
    parts = [done] if task.completed or task.total else [time_text(task.elapsed or 0.0)]
    if task.completed and task.elapsed:
        rate = task.completed / task.elapsed
        parts.append(f"{rate:,.1f}/s")
        if task.total:
            parts.append(f"{time_text((task.total - task.completed) / rate)} left")
    return f"{task.description}: {', '.join([*parts, *(str(field) for field in task.fields.values() if field)])}"
