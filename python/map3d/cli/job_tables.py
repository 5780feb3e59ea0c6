"""What map3d jobs shows: the progress of all renderings or of one, as a document, a line or tables."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

from rich.console import Group, RenderableType
from rich.text import Text

from map3d.catalogue import Catalogue, State
from map3d.cli.output import counts_text, plural, size_text, table, time_text

if TYPE_CHECKING:
    from map3d.jobs.progress_report import ProgressReport

MAX_ROWS: Final = 20
"""Leases and failing blocks that are listed; --json lists more."""


def load_progress(catalogue: Catalogue, rendering: str | None) -> "Overview | Detail":
    if rendering is None:
        return Overview([(item.name, item.scene, catalogue.count_jobs(item.name)) for item in catalogue.renderings()])
    from map3d.jobs.progress_report import report_progress

    return Detail(report_progress(catalogue, rendering))


def _has_open_jobs(counts: dict[State, int]) -> bool:
    return counts[State.TODO] + counts[State.LEASED] > 0


@dataclass(frozen=True)
class Overview:
    """All renderings: name, scene, counts."""

    rows: list[tuple[str, str, dict[State, int]]]

    @property
    def has_open_jobs(self) -> bool:
        return any(_has_open_jobs(counts) for _, _, counts in self.rows)

    def document(self) -> Any:
        return [{"rendering": name, "scene": scene, "counts": counts} for name, scene, counts in self.rows]

    def line(self) -> str:
        return "; ".join(f"{name}: {_share(counts)}, {counts_text(counts)}" for name, _, counts in self.rows) or "no renderings"

    def display(self) -> RenderableType:
        states = [state for state in State if any(counts[state] for _, _, counts in self.rows)]
        rows = [(name, scene, _share(counts), *(counts[state] for state in states)) for name, scene, counts in self.rows]
        return table(("rendering", "scene", "complete", *states), rows)


@dataclass(frozen=True)
class Detail:
    """One rendering."""

    report: "ProgressReport"

    @property
    def has_open_jobs(self) -> bool:
        return _has_open_jobs(self.report.counts)

    def document(self) -> Any:
        return {**asdict(self.report), "open_jobs": self.report.open_jobs, "complete": self.report.is_complete}

    def line(self) -> str:
        report = self.report
        hosts = len({lease.host for lease in report.leases})
        workers = f"{plural(len(report.leases), 'worker')} on {plural(hosts, 'host')}" if report.leases else "no workers"
        parts = [f"{report.rendering}: {_share(report.counts)}", counts_text(report.counts), workers, size_text(report.bytes)]
        if report.jobs_per_s and report.seconds_left is not None:
            parts += [f"{report.jobs_per_s:.2g} blocks/s", f"{time_text(report.seconds_left)} left"]
        return ", ".join(parts)

    def display(self) -> RenderableType:
        parts: list[RenderableType] = [Text(self.line()), self._levels()]
        parts += [self._leases()] if self.report.leases else []
        parts += [self._failing()] if self.report.failing else []
        if self.report.counts[State.QUARANTINED]:
            name = self.report.rendering
            parts.append(Text(f"map3d jobs reproduce {name} BLOCK renders one of them alone; map3d jobs retry {name} opens them again"))
        return Group(*parts)

    def _levels(self) -> RenderableType:
        levels = self.report.levels
        states = [state for state in State if self.report.counts[state]]
        rows = [
            (item.track, item.level, item.kind, _share(item.counts), *(item.counts.get(state, 0) for state in states))
            for item in sorted(levels, key=lambda item: (item.track, -item.level))
        ]
        return table(("track", "level", "kind", "complete", *states), rows)

    def _leases(self) -> RenderableType:
        leases = sorted(self.report.leases, key=lambda lease: -(lease.seconds or 0.0))
        rows = [
            (
                lease.host,
                lease.track,
                lease.block,
                lease.kind,
                lease.attempt,
                None if lease.seconds is None else time_text(lease.seconds),
                lease.worker,
            )
            for lease in leases[:MAX_ROWS]
        ]
        return table(("host", "track", "block", "kind", "attempt", "for", "worker"), rows, _title("leased now", len(leases)))

    def _failing(self) -> RenderableType:
        failing = sorted(self.report.failing, key=lambda job: job.state is not State.QUARANTINED)
        rows = [(job.track, job.block, job.kind, job.state, job.attempts, job.expiries, job.reason) for job in failing[:MAX_ROWS]]
        columns = ("track", "block", "kind", "state", "attempts", "expired", "reason")
        return table(columns, rows, _title("failed", len(failing)))


def _title(text: str, count: int) -> str:
    return text if count <= MAX_ROWS else f"{text} (the first {MAX_ROWS} of {count:,})"


def _share(counts: dict[State, int]) -> str:
    total = sum(counts.values())
    done = counts.get(State.DONE, 0)
    return "–" if not total else f"{100 * done // total} %"
