"""How far a long operation is: a bar on a terminal, a line now and then in a log."""

import time
from typing import Any, Final

from rich.console import Console
from rich.progress import Progress, ProgressColumn, Task, TaskID

from map3d.cli.output import console, time_text

LINE_EVERY_S: Final = 20.0


def progress_bar(*columns: ProgressColumn) -> Progress:
    """On standard error; a bar is gone when its operation is done. In a log an operation that takes long says every `LINE_EVERY_S` where it is."""
    shown = console()
    return Progress(*columns, console=shown, transient=True) if shown.is_terminal else LoggedProgress(shown)


def show_stage(bar: Progress, task_id: TaskID, stage: str, done: int, total: int | None) -> None:
    """How far a stage of an operation is. Each has a clock of its own, so that its rate and the time left are its own too."""
    if bar.tasks[bar.task_ids.index(task_id)].description != stage:
        bar.reset(task_id, description=stage)
    bar.update(task_id, completed=done, total=total)


class LoggedProgress(Progress):
    """Prints `rendering: 40 of 120, 1.3/s, 62 s left, 10 base tiles/s` instead of drawing."""

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
    """A task in words: how many of how many, the rate, the time left as far as they are known, and what its fields say."""
    done = f"{task.completed:,.0f} of {task.total:,.0f}" if task.total else f"{task.completed:,.0f}"
    parts = [done] if task.completed or task.total else [time_text(task.elapsed or 0.0)]
    if task.completed and task.elapsed:
        rate = task.completed / task.elapsed
        parts.append(f"{rate:,.1f}/s")
        if task.total:
            parts.append(f"{time_text((task.total - task.completed) / rate)} left")
    return f"{task.description}: {', '.join([*parts, *(str(field) for field in task.fields.values() if field)])}"
