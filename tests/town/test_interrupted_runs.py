"""Interrupted and killed runs, their resumption, and disk space."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from map3d_town import TownError, TownSpec, estimate_town, make_town
from map3d_town.output_folder import JOURNAL, PART, lock_folder

SPEC = TownSpec(buildings=60, files=6, texture_px=256, trees=False, ortho_px=2500)
SCRIPT = """
import os
from pathlib import Path
import signal
import sys
from map3d_town import make_town
from tests.town.test_interrupted_runs import SPEC


def interrupt(_kind, done, _all):
    if done == 4:
        sent = int(sys.argv[2])
        os.killpg(0, sent) if sent == signal.SIGINT else os.kill(os.getpid(), sent)


if __name__ == "__main__":
    # A shell ignores SIGINT in background processes, and their children inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    make_town(Path(sys.argv[1]), SPEC, interrupt, workers=2)
"""
"""Generates the town and sends itself a signal after four jobs."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("whole")
    make_town(out, SPEC)
    return content(out)


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def start(tmp_path: Path, sent: signal.Signals) -> subprocess.Popen[bytes]:
    """Starts SCRIPT, with two workers, in a process group of its own."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, str(script), str(tmp_path / "out"), str(int(sent))]
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, start_new_session=True)


def pids_in_group(group: int) -> list[int]:
    """Returns the running processes of a group, without zombies, from /proc."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == group and fields[0] != "Z":
            found.append(int(stat.parent.name))
    return found


@pytest.mark.skipif(not Path("/proc/self/stat").is_file(), reason="needs /proc")
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_interrupted_run_keeps_complete_files_and_the_next_one_gives_the_same_bytes(
    sent: signal.Signals, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    out = tmp_path / "out"
    process = start(tmp_path, sent)
    process.communicate(timeout=120)
    assert process.returncode != 0
    deadline = time.monotonic() + 20
    while pids_in_group(process.pid):
        assert time.monotonic() < deadline, "workers still run after their parent ended"
        time.sleep(0.05)
    complete = {name for name in content(out) if not Path(name).name.startswith(".") and name != "town.json"}
    assert 6 <= len(complete) < len(whole) - 1
    if sent == signal.SIGINT:
        assert not list(out.rglob(f".*{PART}"))
    report = make_town(out, SPEC, workers=2)
    assert report.kept == len(complete)
    assert report.written == len(whole) - 1 - len(complete)
    assert content(out) == whole


def test_files_in_the_journal_are_kept_except_for_an_incomplete_line(tmp_path: Path, whole: dict[str, bytes]) -> None:
    make_town(tmp_path, SPEC)
    path = tmp_path / "town.json"
    record = json.loads(path.read_text())
    files = sorted(record["files"].items())
    path.write_text(json.dumps({**record, "files": dict(files[:5])}))
    lines = "".join(json.dumps(row) + "\n" for row in files[5:-1])
    (tmp_path / JOURNAL).write_text(lines + json.dumps(files[-1])[:-1])
    assert make_town(tmp_path, SPEC).written == 1
    assert content(tmp_path) == whole


def test_partial_file_of_a_killed_run_is_removed(tmp_path: Path, whole: dict[str, bytes]) -> None:
    partial = tmp_path / "terrain" / f".ortho.tif{PART}"
    partial.parent.mkdir()
    partial.write_bytes(b"half")
    make_town(tmp_path, SPEC)
    assert content(tmp_path) == whole


def test_second_run_in_the_same_folder_raises(tmp_path: Path) -> None:
    with lock_folder(tmp_path), pytest.raises(TownError, match="another process"):
        make_town(tmp_path, SPEC)


def test_town_of_another_version_raises(tmp_path: Path) -> None:
    (tmp_path / "town.json").write_text(json.dumps({"map3d": "town", "version": 1, "spec": SPEC.to_json(), "files": {}}))
    with pytest.raises(TownError, match="version 1"):
        make_town(tmp_path, SPEC)


@pytest.mark.parametrize(
    "spec",
    [
        SPEC,
        TownSpec(buildings=24, files=3, textures=10, texture_px=256, formats=("citygml", "obj")),
        TownSpec(style="roman", buildings=40, texture_px=256, seed=4),
    ],
    ids=["small", "both formats", "roman"],
)
def test_estimate_is_within_15_percent(spec: TownSpec, tmp_path: Path) -> None:
    estimate = estimate_town(spec)
    make_town(tmp_path, spec, workers=2)
    truth = sum(path.stat().st_size for path in tmp_path.rglob("*") if path.is_file())
    assert abs(estimate.disk_bytes / truth - 1) < 0.15


def test_tight_disk_space_is_compared_with_a_sample(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sampled estimate decides when less than four times the rough estimate is free."""
    needed = estimate_town(SPEC).disk_bytes + (64 << 20)
    for free, opening_fits in ((needed + 1000, True), (needed - 1000, False)):
        monkeypatch.setattr("shutil.disk_usage", lambda _, free=free: type("Usage", (), {"free": free})())
        if opening_fits:
            assert make_town(tmp_path / "town", SPEC).written
        else:
            with pytest.raises(TownError, match="MiB are free"):
                make_town(tmp_path / "refused", SPEC)
