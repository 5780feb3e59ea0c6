"""A rendering of 8 × 8 base blocks without a scene."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from map3d.catalogue import Catalogue, PlannedJob, RenderingRecord, SceneRecord, State, Workspace
from map3d.geometry.frames import pin
from map3d.jobs.events import RunEvent
from map3d.jobs.pool import Pool
from map3d.jobs.run_statistics import RunStatistics
from map3d.jobs.timeouts import Timeouts
from map3d.renderings.render_task import RenderTask
from map3d.tiles.naming import block_above, morton
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId, Layer, ViewAngles

VIEW = "0-45"
ENTRY = "tests.jobs.faults:open_faulty"
LEASE_S, TIMEOUTS = 2.0, Timeouts(heartbeat_s=0.5, block_s=1.5, start_s=30, idle_s=0.1, tick_s=0.1)
LAYERS = (Layer("color", "color", "webp", 80), Layer("id", "id", "png"))
BOX = ((0.0, 0.0, 0.0), (100.0, 100.0, 10.0))
BLOCKS = 8


@dataclass
class Town:
    workspace: Workspace
    catalogue: Catalogue
    rendering: RenderingRecord

    def pool(self, size: int = 2, timeouts: Timeouts = TIMEOUTS) -> Pool:
        self.task = RenderTask(self.workspace, self.rendering, entry=ENTRY)
        return Pool(self.catalogue, self.rendering.name, self.task, size, timeouts)

    def run(self, size: int = 2, timeouts: Timeouts = TIMEOUTS) -> tuple[RunStatistics, list[RunEvent]]:
        events: list[RunEvent] = []
        statistics = self.pool(size, timeouts).run(events.append)
        self.task.close()
        return statistics, events

    def count(self, state: State) -> int:
        return self.catalogue.count_jobs(self.rendering.name)[state]

    def digest(self) -> str:
        """Returns a digest of every tile and seam in the store."""
        total = hashlib.sha256()
        with SqliteTileStore(self.workspace.store_path(self.rendering.name, VIEW), read_only=True) as store:
            for block in store.list_blocks():
                total.update(f"{block}".encode() + (store.get_seam(block.id) or b"-"))
            for layer in range(len(LAYERS)):
                for tile in store.list_tiles(layer):
                    total.update(f"{tile}".encode() + (store.get_tile(layer, *tile) or b"-"))
        return total.hexdigest()

    def close(self) -> None:
        self.catalogue.close()


def make_town(root: Path) -> Town:
    workspace = Workspace(root).create()
    catalogue = workspace.open_catalogue(lease_s=LEASE_S)
    catalogue.create_scene(SceneRecord("town"))
    frames = tuple(pin(BOX, 256, 0.02, [ViewAngles(0, 45)]))
    rendering = RenderingRecord("town-a", "town", 0.02, (LAYERS,), frames, BOX)
    catalogue.create_rendering(rendering)
    catalogue.plan("town-a", planned_jobs(rendering))
    return Town(workspace, catalogue, rendering)


def planned_jobs(rendering: RenderingRecord, key: str = "key") -> list[PlannedJob]:
    base = rendering.zmax - 3
    jobs = [planned(BlockId(base, x, y), "base", rendering.zmax, key) for x in range(BLOCKS) for y in range(BLOCKS)]
    above = {job.parent for job in jobs}
    while above:
        reduces = [planned(block, "reduce", rendering.zmax, key) for block in sorted(block for block in above if block is not None)]
        jobs += reduces
        above = {job.parent for job in reduces}
    return jobs


def planned(block: BlockId, kind: str, zmax: int, key: str) -> PlannedJob:
    number, above = morton(block.x, block.y), block_above(block, zmax)
    return PlannedJob(VIEW, block, "base" if kind == "base" else "reduce", number, f"{key} {block}", above, number)


def open_town(root: Path, lease_s: float = LEASE_S) -> Town:
    """Opens the same town from another process."""
    workspace = Workspace(root)
    catalogue = workspace.open_catalogue(lease_s=lease_s)
    return Town(workspace, catalogue, catalogue.rendering("town-a"))
