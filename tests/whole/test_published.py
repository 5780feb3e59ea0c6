"""Folders written by `map3d site` and `map3d publish`, opened from a static host; one site run is stopped twice."""

import os
import re
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from map3d.catalogue import State, Workspace
from map3d.cli.app import run
from map3d.publish.pmtiles_archive import Archive
from map3d.registry import Registry
from map3d.types import TileId
from map3d_town.teatime import write_teatime
from tests.publish.hosts import static_host
from tests.whole.browsing import browse, command, picture
from tests.whole.core_pixels import CoreView, VisibleObject

pytestmark = pytest.mark.browser

SIZE = (720, 560)


@pytest.fixture(scope="module")
def teatime(tmp_path_factory: pytest.TempPathFactory) -> Path:
    files = tmp_path_factory.mktemp("files") / "teatime"
    write_teatime(files)
    return files


def site(files: Path, root: Path) -> list[str]:
    """Returns the command that publishes `files` as `root`/out, with the workspace `root`/workspace."""
    return command("site", files, "-o", root / "out", "-w", root / "workspace", "--res", "0.05")


@pytest.fixture(scope="module")
def undisturbed(teatime: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("undisturbed")
    subprocess.run(site(teatime, root), check=True)
    return root


def blocks_done(root: Path) -> int:
    if not (root / "workspace").is_dir():
        return 0
    catalogue = Workspace(root / "workspace").open_catalogue()
    try:
        return sum(catalogue.count_jobs(record.name)[State.DONE] for record in catalogue.renderings())
    finally:
        catalogue.close()


def stopped_after(files: Path, root: Path, blocks: int, number: signal.Signals) -> int:
    """Runs the command in its own process group, as a shell does, and sends it a signal after `blocks` blocks; returns its exit status."""
    process = subprocess.Popen(site(files, root), process_group=0, stderr=subprocess.DEVNULL)
    deadline_s = time.monotonic() + 60
    while blocks_done(root) < blocks:
        assert process.poll() is None, "the command ended before it could be stopped"
        assert time.monotonic() < deadline_s
        time.sleep(0.01)
    os.killpg(process.pid, number)
    return process.wait(60)


def let_leases_expire(root: Path) -> None:
    """Makes all leases overdue, since a killed process cannot release its blocks."""
    catalogue = Workspace(root / "workspace").open_catalogue()
    with catalogue._database.transaction() as db:
        db.execute("UPDATE job SET expires = expires - 3600 WHERE state = 'leased'")
    catalogue.close()


def tiles_of(folder: Path) -> dict[str, list[tuple[TileId, bytes]]]:
    """Returns the tiles by archive; the archives themselves also differ in block versions."""
    return {str(path.relative_to(folder)): list(Archive(path).tiles()) for path in sorted(folder.rglob("*.pmtiles"))}


def test_stopped_and_killed_site_resumes_and_has_the_same_tiles(teatime: Path, undisturbed: Path, tmp_path: Path) -> None:
    assert stopped_after(teatime, tmp_path, 4, signal.SIGINT) == 130
    done = blocks_done(tmp_path)
    assert not (tmp_path / "out").exists()
    assert stopped_after(teatime, tmp_path, done + 4, signal.SIGKILL) == -signal.SIGKILL
    assert not (tmp_path / "out").exists()
    let_leases_expire(tmp_path)
    subprocess.run(site(teatime, tmp_path), check=True)
    assert run(["verify", "--published", str(tmp_path / "out")]) == 0
    expected, got = tiles_of(undisturbed / "out"), tiles_of(tmp_path / "out")
    assert len(expected) == 12, "four views, three layers"
    assert [name for name in expected | got if expected.get(name) != got.get(name)] == []


def visit(folder: Path, view: CoreView, known: VisibleObject, label: str, name: str) -> dict[str, Any]:
    with static_host(folder) as address:
        return browse(
            "published.mjs",
            address=f"{address}/index.html",
            direction=view.frame.id,
            position=known.position,
            zoom=view.frame.zmax,
            label=label,
            size=SIZE,
            picture=re.sub(r"\.png$", "", picture(f"{name}.png")),
        )


def test_site_of_files_without_attributes_works(undisturbed: Path) -> None:
    view = CoreView(undisturbed / "workspace", "teatime", "0-45")
    known = next(place for place in view.find_objects(None, 9) if place.name == "teapot")
    seen = visit(undisturbed / "out", view, known, "cube", "site")
    assert seen["problems"] == []
    assert (seen["title"], seen["clicked"]["name"], seen["found"]["name"]) == ("teatime", "teapot", "cube")
    assert (seen["turned"], seen["pictures"]) == ("90-45", 4)
    assert seen["ranges"] > 10


def test_published_town_can_be_clicked_and_searched(workspace: Path, tmp_path: Path) -> None:
    assert run(["publish", "town", "-o", str(tmp_path / "out"), "-w", str(workspace)]) == 0
    view = CoreView(workspace, "town", "90-45")
    known, other = view.find_objects("building", 2)
    seen = visit(tmp_path / "out", view, known, other.name, "published")
    assert seen["problems"] == []
    assert seen["clicked"]["name"] == known.name
    assert not seen["clicked"]["covers"], "the panel covers the buttons"
    assert seen["found"]["name"] == other.name
    assert (seen["turned"], seen["pictures"]) == ("180-45", 4)
    with Registry(workspace / "scenes" / "town" / "registry.sqlite") as registry:
        item = registry.get(known.id)
    assert item is not None
    assert item.attributes
    shown = seen["clicked"]["attributes"]
    assert {name: str(value) for name, value in item.attributes.items()}.items() <= shown.items()
