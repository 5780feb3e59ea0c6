"""`map3d jobs reproduce`: a faulty block alone tells how it fails, and changes nothing."""

from dataclasses import replace
from pathlib import Path

import pytest

from map3d.catalogue import State
from map3d.errors import NotFound
from map3d.jobs.reproduce import Reproduction, reproduce
from map3d.jobs.run_settings import RunSettings
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId
from tests.jobs.town import ENTRY, TIMEOUTS, VIEW, Town

OUTCOMES = {
    "segfault": ("died", "SIGSEGV", "SIGSEGV"),
    "abort": ("died", "SIGABRT", "SIGABRT"),
    "exit 0": ("died", None, "exit status 0"),
    "hang": ("timed out", None, "1.5 s"),
    "exception": ("failed", None, "ValueError: faulty block"),
    "stale": ("scene changed", None, "StalePlan"),
    "memory": ("died", None, "exit status 1"),
}


def try_block(town: Town, block: BlockId, **settings: object) -> Reproduction:
    (found,) = reproduce(town.workspace, town.catalogue, "town-a", block, replace(RunSettings(1, timeouts=TIMEOUTS, entry=ENTRY), **settings))
    return found


@pytest.mark.parametrize("kind", OUTCOMES)
def test_faulty_block_tells_how_it_failed(town: Town, faults: Path, kind: str) -> None:
    block = BlockId(town.rendering.zmax - 3, 3, 5)
    (faults / f"{block.z}-3-5").write_text(kind)
    before = list(town.catalogue.jobs("town-a"))
    found = try_block(town, block, timeouts=TIMEOUTS if kind == "hang" else replace(TIMEOUTS, block_s=60))
    outcome, signal, reason = OUTCOMES[kind]
    assert (found.outcome, found.signal, found.tiles) == (outcome, signal, {})
    assert reason in found.reason
    assert kind != "memory" or found.output[-1] == "MemoryError"
    assert list(town.catalogue.jobs("town-a")) == before


def test_sound_block_tells_its_tiles_and_stores_none(town: Town) -> None:
    block = BlockId(town.rendering.zmax - 3, 3, 4)
    found = try_block(town, block)
    z = town.rendering.zmax
    assert (found.outcome, found.reason, found.signal) == ("done", "", None)
    assert found.tiles == {z - 3: 2, z - 2: 8, z - 1: 32, z: 128}
    assert found.bytes > 0
    assert town.count(State.DONE) == town.count(State.LEASED) == 0
    with SqliteTileStore(town.workspace.store_path("town-a", VIEW), read_only=True) as store:
        assert store.list_blocks() == []


def test_longer_timeout_lets_a_slow_block_end(town: Town, faults: Path) -> None:
    (faults / "slow").write_text("2")
    block = BlockId(town.rendering.zmax - 3, 3, 4)
    assert try_block(town, block).outcome == "timed out"
    assert try_block(town, block, timeouts=replace(TIMEOUTS, block_s=60)).outcome == "done"


def test_unknown_blocks_and_tracks_are_refused(town: Town) -> None:
    settings = RunSettings(1, entry=ENTRY)
    with pytest.raises(NotFound, match="no block 0/7/7"):
        reproduce(town.workspace, town.catalogue, "town-a", BlockId(0, 7, 7), settings)
    with pytest.raises(NotFound, match="no track '1-1'; its tracks are 0-45"):
        reproduce(town.workspace, town.catalogue, "town-a", BlockId(0, 0, 0), settings, "1-1")
