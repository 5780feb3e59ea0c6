"""A rendering of the library."""

from datetime import date, datetime
from os import PathLike
from typing import Any

from map3d.catalogue import Catalogue, RenderingRecord, Workspace
from map3d.cores import usable_cores
from map3d.geometry.sun import GeographicPosition, SunAngles
from map3d.jobs.dead_workers import expire_dead_workers
from map3d.jobs.events import RunEvent
from map3d.jobs.progress_report import ProgressReport, report_progress
from map3d.jobs.run import Run, RunResult
from map3d.jobs.run_counter import RunCounter
from map3d.jobs.run_settings import RunSettings
from map3d.library.on_progress import OnProgress, building, publishing
from map3d.lifecycle.change_rendering import change_rendering
from map3d.lifecycle.create_rendering import add_layers, add_views
from map3d.lifecycle.remove_rendering import find_rendering, remove_rendering
from map3d.publish import Published, publish
from map3d.renderings.cost_estimate import RenderingEstimate, estimate
from map3d.requests import AddLayers, ChangeRendering
from map3d.scenes.build import build_if_stale
from map3d.types import ViewAngles


class LibraryRendering:
    """Get it from a workspace or a scene. It holds no data: every property asks the catalogue."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue, name: str) -> None:
        self._workspace, self._catalogue, self.name = workspace, catalogue, name

    @property
    def record(self) -> RenderingRecord:
        """Views, layers, resolution. Raises NotFound after the rendering was removed."""
        return self._catalogue.rendering(self.name)

    @property
    def scene_name(self) -> str:
        return self.record.scene

    def estimate(self, *, workers: int | None = None, max_memory_bytes: int | None = None, progress: OnProgress | None = None) -> RenderingEstimate:
        """Builds the scene if its files have changed, and estimates tiles, bytes and seconds before they are rendered."""
        self._build(workers, max_memory_bytes, progress)
        return estimate(self._workspace, self._catalogue, self.name, workers or usable_cores())

    def render(
        self,
        *,
        workers: int | None = None,
        max_memory_bytes: int | None = None,
        retry_quarantined: bool = False,
        progress: OnProgress | None = None,
    ) -> RunResult:
        """Builds the scene if its files have changed, and renders the missing and changed tiles, with one process per core unless given. Other runs
        may help. Ctrl-C in the main thread finishes the current blocks; calling it again resumes.

        Returns how it ended: `complete`, `stopped`, and the number of blocks that are left or in quarantine.
        """
        self._build(workers, max_memory_bytes, progress)
        if retry_quarantined:
            self._catalogue.retry(self.name)
        run = Run(self._workspace, self._catalogue, self.name, RunSettings(workers or usable_cores(), max_memory_bytes))
        plan = run.plan(lambda done, total: _show(progress, "planning", done, total))
        counter = RunCounter()

        def on_event(event: RunEvent) -> None:
            counter(event)
            _show(progress, "rendering", counter.done, counter.total)

        return run.work(plan, on_event)

    def progress(self) -> ProgressReport:
        """Returns the number of blocks in every state, workers, failures with their reasons, rate and time left."""
        return report_progress(self._catalogue, self.name)

    def change(
        self,
        *,
        title: str | None = None,
        attribution: str | None = None,
        description: str | None = None,
        start_view: tuple[float, float] | None = None,
    ) -> None:
        """Changes what the map says and how it opens; None leaves it as it is. `start_view`: look-at angle and pitch. Raises BadRequest."""
        view = None if start_view is None else ViewAngles(*start_view)
        request = ChangeRendering(title=title, attribution=attribution, description=description, start_view=view)
        change_rendering(self._workspace, self._catalogue, self.name, request)

    def add_views(self, *views: tuple[float, float]) -> None:
        """Adds views, as (look-at angle, pitch); `render` renders them. Raises BadRequest, OutsideFrame."""
        add_views(self._catalogue, self.name, [ViewAngles(*view) for view in views])

    def add_layers(
        self,
        *layers: str,
        color: str = "webp",
        quality: int = 80,
        small: bool = False,
        time: datetime | None = None,
        sun: tuple[float, float] | None = None,
        day: date | None = None,
        radius_m: float | None = None,
        place: tuple[float, float] | None = None,
    ) -> None:
        """Adds layers, each as KIND or NAME=KIND, to all views; `render` renders them. `sun`: azimuth and elevation; `place`: latitude and longitude.
        Raises BadRequest, AlreadyExists."""
        details: dict[str, Any] = {"color": color, "quality": quality, "small": small, "time": time, "day": day, "radius_m": radius_m}
        add_layers(self._catalogue, self.name, AddLayers(layers=layers, **details, **light_of(sun, place)))

    def publish(
        self,
        out: str | PathLike[str],
        *,
        replace: bool = False,
        allow_incomplete: bool = False,
        dry_run: bool = False,
        url: str | None = None,
        gis: bool = False,
        max_file_bytes: int | None = None,
        progress: OnProgress | None = None,
    ) -> Published:
        """Writes a folder for any static web host, or sends it to the URL of an object store. A publication of the
        same rendering is updated; `replace` replaces that of another one. Raises AlreadyExists, BadRequest (incomplete)."""
        how: dict[str, Any] = {"replace": replace, "allow_incomplete": allow_incomplete, "dry_run": dry_run, "url": url, "gis": gis}
        how["max_file_bytes"] = max_file_bytes
        return publish(self._workspace, self.name, str(out), progress=publishing(progress), **how)

    def remove(self) -> None:
        """Removes the rendering with its tiles. Raises BadRequest while it is being rendered."""
        expire_dead_workers(self._catalogue, self.name)
        remove_rendering(self._workspace, self._catalogue, find_rendering(self._workspace, self._catalogue, self.name))

    def _build(self, workers: int | None, max_memory_bytes: int | None, progress: OnProgress | None) -> None:
        show = building(progress)
        build_if_stale(self._workspace, self._catalogue, self.scene_name, threads=workers, max_memory_bytes=max_memory_bytes, progress=show)

    def __repr__(self) -> str:
        return f"<map3d rendering {self.name!r}>"


def light_of(sun: tuple[float, float] | None, place: tuple[float, float] | None) -> dict[str, Any]:
    return {"sun": None if sun is None else SunAngles(*sun), "place": None if place is None else GeographicPosition(*place)}


def _show(progress: OnProgress | None, stage: str, done: int, total: int) -> None:
    if progress is not None:
        progress(stage, done, total)
