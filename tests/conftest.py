from collections.abc import Iterator
from pathlib import Path

import pytest
from xdist.scheduler import LoadScopeScheduling

from tests.catalogue.mongo_process import MongoProcess, Unavailable, build, real_server
from tests.leftovers import nothing_is_left, own_temporary_folder, session_processes
from tests.object_servers import environment, new_prefix, s3_environment, s3_server

ALONE = ("bench", "faults", "jobs", "subprocess", "test_process_identity.py")
"""Folders and files whose tests measure or kill processes: one worker runs all of them, so that they do not disturb each other."""


class FileScheduling(LoadScopeScheduling):
    """Gives a worker whole files, and those of ALONE as one."""

    def _split_scope(self, nodeid: str) -> str:
        file = nodeid.partition("::")[0]
        return "alone" if file.split("/")[1] in ALONE else file


@pytest.hookimpl
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> FileScheduling | None:
    return FileScheduling(config, log) if config.getvalue("dist") == "loadgroup" else None


@pytest.fixture(scope="session")
def temporary_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The folder of temporary files of this process and those that it starts; pytest's own are elsewhere."""
    tmp_path_factory.getbasetemp()
    with own_temporary_folder() as folder:
        yield folder


@pytest.fixture(scope="module", autouse=True)
def leftovers(temporary_folder: Path) -> Iterator[None]:
    """Fails the last test of a file whose tests leave processes, temporary files or open sockets."""
    with nothing_is_left(temporary_folder):
        yield


@pytest.fixture(scope="session")
def s3_endpoint() -> Iterator[str]:
    """The endpoint of an S3 server on loopback."""
    with s3_server() as endpoint:
        yield endpoint


@pytest.fixture
def s3_url(s3_endpoint: str) -> Iterator[str]:
    """The URL of an empty place in a bucket, with the environment that opens it."""
    with environment(s3_environment(s3_endpoint)):
        yield new_prefix()


@pytest.fixture(params=["file", "s3"])
def store_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """The URL of an empty object store of each type."""
    return str(request.getfixturevalue("s3_url")) if request.param == "s3" else (tmp_path / "objects").as_uri()


@pytest.fixture(scope="session")
def mongo_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The URL, without a database, of a MongoDB server that all tests share; each test uses a database of its own."""
    if (url := real_server()) is not None:
        yield url
        return
    try:
        build()
        process = MongoProcess(tmp_path_factory.mktemp("mongodb")).start()
    except Unavailable as error:
        pytest.skip(f"MongoDB is not tested: {error}")
    session_processes.add(process.pid)
    yield process.url
    process.stop()


@pytest.fixture
def own_mongo_server(tmp_path: Path) -> Iterator[MongoProcess]:
    """A MongoDB server that the test may end and start again."""
    try:
        build()
        process = MongoProcess(tmp_path).start()
    except Unavailable as error:
        pytest.skip(f"MongoDB is not tested: {error}")
    yield process
    process.stop()
