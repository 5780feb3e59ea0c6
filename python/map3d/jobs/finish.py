"""The manifest at the end of a run: the run that does the last job writes it, whichever command it belongs to."""

from dataclasses import dataclass
from typing import Self

from map3d.catalogue import Catalogue, RenderingRecord, State, Workspace
from map3d.errors import Map3dError
from map3d.renderings.manifest_writer import Planned, write_manifest
from map3d.renderings.plan import PlannedScene, planned_occupancy
from map3d.scenes.build import open_scene
from map3d.scenes.scene_cache import scene_in_use
from map3d.tiles.manifest import Manifest
from map3d.tiles.occupancy import Numbers, Occupancy, numbers_of
from map3d.tiles.track_stores import read_manifest
from map3d.types import Box


@dataclass(frozen=True)
class PlannedOccupancy:
    """`box`: of the scene that was planned; `occupancy`: the base tiles of each view that open blocks of its first pass may fill."""

    box: Box
    occupancy: Planned

    @classmethod
    def of_scene(cls, catalogue: Catalogue, record: RenderingRecord, scene: PlannedScene, *, is_complete: bool) -> Self:
        """Later passes fill the same tiles as the first."""
        frames = () if is_complete else record.frames
        return cls(scene.box, {frame.id: planned_occupancy(scene, frame, within=_open_blocks(catalogue, record, frame.id)) for frame in frames})

    @classmethod
    def announced(cls, workspace: Workspace, catalogue: Catalogue, record: RenderingRecord) -> Self:
        """Returns what the run that planned the rendering announced; what the scene says if that run was killed before it wrote the manifest."""
        try:
            data = read_manifest(workspace, record)
            manifest = None if data is None else Manifest.load(data, str(workspace.manifest_path(record.name)))
        except (OSError, Map3dError):
            manifest = None
        if manifest is None or manifest.content_version != record.content_version:
            return cls.of_scene(catalogue, record, open_scene(workspace, record.scene), is_complete=False)
        return cls(manifest.box, {view.frame.id: view.occupancy for view in manifest.views})


def finish(workspace: Workspace, catalogue: Catalogue, rendering: str, expected: PlannedOccupancy | None = None) -> bool:
    """Writes the manifest of the rendering's present state; returns whether all its jobs are done. `expected`: None for that of the last plan."""
    record, counts = catalogue.rendering(rendering), catalogue.count_jobs(rendering)
    is_complete = counts[State.DONE] == sum(counts.values())
    with scene_in_use(workspace, catalogue.scene(record.scene)):
        expected = expected or PlannedOccupancy.announced(workspace, catalogue, record)
        write_manifest(workspace, catalogue, rendering, expected.box, {} if is_complete else _within_open(catalogue, record, expected.occupancy))
    return is_complete


def _open_blocks(catalogue: Catalogue, record: RenderingRecord, view: str) -> Numbers:
    """Returns the base blocks of the view's first pass that are not done."""
    jobs = catalogue.jobs(record.name, view)
    return numbers_of((job.block.x, job.block.y) for job in jobs if job.kind == "base" and job.state is not State.DONE)


def _within_open(catalogue: Catalogue, record: RenderingRecord, planned: Planned) -> dict[str, Occupancy]:
    """Restricts each view's occupancy to base blocks that are not done now."""
    return {view: occupancy.within(_open_blocks(catalogue, record, view)) for view, occupancy in planned.items()}
