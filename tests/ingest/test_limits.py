"""A misbehaving parser fails only its own import, and a typed error names the limit that it exceeded."""

import dataclasses
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from map3d.catalogue import Catalogue, SceneRecord, Workspace
from map3d.errors import ImportFailed, LimitExceeded
from map3d.ingest.import_options import BIG_FILE_BYTES, GIB, ImportOptions
from map3d.ingest.importing import import_file
from map3d.ingest.parser_process import ParserProcess
from map3d.ingest.sources import SourceDocument, find_sources
from map3d.subprocess import Limits, Message, Subprocess

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path / "workspace").create()


@pytest.fixture
def catalogue(workspace: Workspace) -> Iterator[Catalogue]:
    opened = workspace.open_catalogue()
    opened.create_scene(SceneRecord("town"))
    yield opened
    opened.close()


@pytest.fixture
def source(tmp_path: Path) -> SourceDocument:
    (tmp_path / "a.obj").write_text(OBJ)
    return find_sources([tmp_path / "a.obj"])[0]


@pytest.mark.parametrize(
    ("entry", "options", "error", "says"),
    [
        ("open_greedy", ImportOptions(), LimitExceeded, "1024 MiB of address space.*--parse-memory"),
        ("open_greedy", ImportOptions(parse_memory_bytes=3 << 30), LimitExceeded, "3072 MiB of address space"),
        ("open_busy", ImportOptions(parse_cpu_s=1), LimitExceeded, "1 s of CPU time.*--parse-cpu"),
        ("open_asleep", ImportOptions(parse_cpu_s=1), LimitExceeded, "took longer than 14 s.*--parse-cpu"),
        ("open_crash", ImportOptions(), ImportFailed, "SIGABRT"),
    ],
)
def test_a_parser_over_its_limits_is_ended_with_an_explanation(
    workspace: Workspace, catalogue: Catalogue, source: SourceDocument, entry: str, options: ImportOptions, error: type[Exception], says: str
) -> None:
    begun = time.monotonic()
    with pytest.raises(error, match=says) as refused:
        import_file(workspace, catalogue, "town", source, options, entry=f"tests.ingest.misbehaving_parsers:{entry}")
    assert str(source.paths[0]) in str(refused.value)
    assert time.monotonic() - begun < 30
    assert catalogue.assets("town") == []
    assert list((workspace.scene_folder("town") / "assets").iterdir()) == []


def test_a_parser_has_no_network_where_the_system_supports_it() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        child = Subprocess("tests.ingest.misbehaving_parsers:open_curious", {}, limits=Limits(network=False))
        applied = child.wait_ready(30)
        answer = child.request({"port": server.getsockname()[1]}, wall_s=10)
        child.close()
    assert isinstance(answer, Message)
    assert answer.value["network"] == applied["network"]


def test_a_parser_can_open_few_files(tmp_path: Path) -> None:
    child = Subprocess("tests.ingest.misbehaving_parsers:open_hoarder", {}, limits=Limits(open_files=64))
    child.wait_ready(30)
    answer = child.request({"folder": str(tmp_path)}, wall_s=10)
    child.close()
    assert isinstance(answer, Message)
    assert 32 < answer.value["files"] < 64


@pytest.mark.parametrize(
    ("size", "memory", "cpu_s"), [(BIG_FILE_BYTES - 1, GIB, 60), (BIG_FILE_BYTES, GIB, 60), (BIG_FILE_BYTES + 1, 2 * GIB, 120), (0, GIB, 60)]
)
def test_limits_grow_with_the_file(tmp_path: Path, size: int, memory: int, cpu_s: int) -> None:
    path = tmp_path / "big.gml"
    with path.open("wb") as file:
        file.truncate(size)
    limits = ImportOptions().limits([path], "citygml")
    assert (limits.address_space_bytes, limits.cpu_s, limits.wall_s, limits.network) == (memory, cpu_s, 10.0 + 4.0 * cpu_s, False)
    raised = dataclasses.replace(ImportOptions(), parse_memory_bytes=5 * GIB, parse_cpu_s=7).limits([path], "citygml")
    assert (raised.address_space_bytes, raised.cpu_s) == (5 * GIB, 7)


def test_the_processor_time_limit_restarts_for_every_file() -> None:
    child = Subprocess("tests.ingest.misbehaving_parsers:open_worker", {}, limits=Limits(cpu_s=1))
    child.wait_ready(30)
    for _ in range(2):
        assert isinstance(child.request({"cpu_s": 0.7}, wall_s=30), Message)
    with pytest.raises(LimitExceeded):
        child.request({"cpu_s": 3.0}, wall_s=60)
    child.close()


def test_one_process_parses_many_files_until_one_fails() -> None:
    with ParserProcess() as parser:
        limits = Limits(open_files=64)
        first, _ = parser.get("tests.subprocess.echo:open_echo", limits)
        assert parser.get("tests.subprocess.echo:open_echo", limits)[0] is first
        with parser:
            pass
        assert isinstance(first.request({}, wall_s=10), Message), "an inner with block does not end it"
        parser.stop()
        second, _ = parser.get("tests.subprocess.echo:open_echo", limits)
        assert second is not first
        assert parser.get("tests.subprocess.echo:open_echo", Limits(open_files=65))[0] is not second
