"""`map3d jobs repair`: opens the blocks again that `map3d verify` finds wrong or missing."""

from dataclasses import dataclass, field

from map3d.catalogue import Catalogue, State, Workspace
from map3d.tiles.track_stores import find_track
from map3d.types import BlockId
from map3d.verify.findings import Findings
from map3d.verify.pixel_checks import verify_pixels
from map3d.verify.rendering_checks import Progress, verify_rendering


@dataclass(frozen=True)
class Repair:
    """`wrong`: the done blocks that were found wrong or missing; `reopened`: the number of jobs opened again, with those above the wrong ones."""

    rendering: str
    findings: Findings
    wrong: list[tuple[str, BlockId]] = field(default_factory=list)
    reopened: int = 0


def repair(workspace: Workspace, catalogue: Catalogue, rendering: str, progress: Progress, *, sample: int | None, deep: bool, seed: int) -> Repair:
    """Verifies the rendering, removes the wrong blocks from the store and opens their jobs. `sample` and `deep` also render blocks again and compare
    their bytes."""
    findings = Findings()
    verify_rendering(workspace, catalogue, rendering, findings, progress)
    if sample or deep:
        verify_pixels(workspace, catalogue, rendering, findings, progress, sample=None if deep else sample, seed=seed)
    done = {(job.track, job.block) for job in catalogue.jobs(rendering, state=State.DONE)} if findings.blocks else set()
    wrong = sorted(findings.blocks & done)
    _remove(workspace, catalogue, rendering, wrong)
    return Repair(rendering, findings, wrong, catalogue.reopen(rendering, wrong) if wrong else 0)


def _remove(workspace: Workspace, catalogue: Catalogue, rendering: str, wrong: list[tuple[str, BlockId]]) -> None:
    """Removes the blocks before their jobs open: a store keeps stored bytes that should equal those of a new render. After a kill in between, the
    blocks are found missing."""
    record = catalogue.rendering(rendering)
    for track in dict.fromkeys(track for track, _ in wrong):
        if (found := find_track(workspace, record, track, read_only=False)) is not None:
            with found as store:
                for block in (block for own, block in wrong if own == track):
                    store.remove_block(block)
