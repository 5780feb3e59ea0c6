"""The progress of `map3d render` and `map3d work`: a bar with rate and time left, and a line for each problem."""

import time
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from map3d.cli.output import counts_text, plural
from map3d.cli.progress import progress_bar
from map3d.jobs import events
from map3d.jobs.event_messages import problem_message
from map3d.jobs.events import RunEvent


def run_bar(*columns: Any) -> Progress:
    return progress_bar(SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), *columns, TimeElapsedColumn(), TimeRemainingColumn())


class RunProgress:
    """Shows the events of a run; use it as a context. The bar counts the jobs of the current rendering, whichever run does them."""

    def __init__(self) -> None:
        self._bar = run_bar(MofNCompleteColumn(), TextColumn("{task.fields[rate]}"))
        self._task = self._bar.add_task("rendering", total=None, rate="")
        self._started_s, self._base_tiles = time.monotonic(), 0

    def __enter__(self) -> "RunProgress":
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    @property
    def counted(self) -> tuple[float, float | None]:
        """Returns the number of done jobs and of all jobs that the bar shows."""
        shown = self._bar.tasks[self._bar.task_ids.index(self._task)]
        return shown.completed, shown.total

    @property
    def console(self) -> Console:
        return self._bar.console

    def __call__(self, event: RunEvent) -> None:
        if isinstance(event, events.JobDone):
            self._base_tiles += event.result.base_tiles
            rate = self._base_tiles / max(time.monotonic() - self._started_s, 1e-3)
            self._bar.update(self._task, advance=1, rate=f"{rate:,.0f} base tiles/s")
        elif isinstance(event, events.Planned | events.RenderingStarted):
            self._start(event)
        elif isinstance(event, events.Remaining):
            self._show_remaining(event.jobs)
        elif line := message(event):
            self.console.print(line)

    def _start(self, event: events.Planned | events.RenderingStarted) -> None:
        """Counts from the number of jobs that are open now."""
        if isinstance(event, events.Planned):
            name, text = "rendering", plan_text(event)
        else:
            name, text = f"rendering {event.rendering}", f"{event.rendering}: {plural(event.open_jobs, 'block')} to render"
        self.console.print(text)
        self._bar.reset(self._task, total=event.open_jobs, description=name, rate="")
        self._started_s, self._base_tiles = time.monotonic(), 0

    def _show_remaining(self, jobs: int) -> None:
        """Counts the jobs that other runs did or opened."""
        total = max(self.counted[1] or 0, jobs)
        self._bar.update(self._task, total=total, completed=total - jobs)


def plan_text(plan: events.Planned) -> str:
    counts = plan.counts
    return f"blocks: {counts_text({'new': counts.added, 'changed': counts.changed, 'unchanged': counts.kept})}; {plan.open_jobs:,} to render"


def message(event: RunEvent) -> str:
    """Returns the line that reports an event, empty for events without one."""
    if isinstance(event, events.PlanAwaited):
        return f"{event.rendering}: its scene was rebuilt; waiting until map3d render {event.rendering} plans it again"
    if isinstance(event, events.StoreAwaited):
        return f"trying again soon: {event.reason}"
    if isinstance(event, events.RenderingSkipped):
        return f"skipped: {event.reason}"
    if isinstance(event, events.Stopping):
        return "stopping: releasing current blocks" if event.at_once else "stopping after the current blocks; press Ctrl-C again to stop at once"
    if isinstance(event, events.Waiting):
        blocks = plural(event.jobs, "block")
        return f"waiting for {blocks} leased by another run; leases of a run that was killed on another host expire within a minute"
    if isinstance(event, events.RenderingLeft):
        return f"{event.rendering} is complete" if event.complete else f"{event.rendering} is incomplete; see map3d jobs {event.rendering}"
    problem = problem_message(event)
    return str(problem) if problem else ""
