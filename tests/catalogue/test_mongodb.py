"""What is special about the catalogue in MongoDB: kills between any two requests, servers that end and come back, errors, schema."""

import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from pymongo import MongoClient

from map3d.catalogue import Catalogue, JobResult, PlannedJob, SceneRecord, State, mongodb_connection, open_catalogue
from map3d.catalogue.mongodb_connection import VERSION, MongoConnection
from map3d.errors import BadRequest, StaleFence, StoreError, UnknownVersion
from map3d.types import BlockId
from tests.catalogue.implementations import Kill, NewUrl, new_urls, rendering
from tests.catalogue.mongo_process import MongoProcess
from tests.catalogue.pyramids import RESULT, TRACKS, described, pyramid, work_off

TRACK = TRACKS[:1]
BLOCK = (TRACKS[0], BlockId(6, 4, 0))


@pytest.fixture
def new_url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[NewUrl]:
    with new_urls("mongodb", request, tmp_path) as new:
        yield new


def _changed(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", pyramid("Xbcd", tracks=TRACK))


def _reopened(catalogue: Catalogue) -> None:
    catalogue.reopen("town-a", [BLOCK])


def _cancelled(catalogue: Catalogue) -> None:
    catalogue.reopen("town-a", [BLOCK])
    catalogue.cancel("town-a")


def _retried(catalogue: Catalogue) -> None:
    _cancelled(catalogue)
    catalogue.retry("town-a")


def _regridded(catalogue: Catalogue) -> None:
    catalogue.regrid(rendering())
    catalogue.plan("town-a", pyramid("Xbcd", tracks=TRACK))


def _done_again(catalogue: Catalogue) -> None:
    catalogue.reopen("town-a", [BLOCK])
    catalogue.expire("town-a", ["w"])
    work_off(catalogue)


@pytest.mark.parametrize("operation", [_changed, _reopened, _cancelled, _retried, _regridded, _done_again])
@pytest.mark.parametrize("executed", [False, True], ids=["before", "after"])
def test_operation_killed_before_or_after_any_request_can_be_repeated(
    make_catalogue: Callable[[], Catalogue], monkeypatch: pytest.MonkeyPatch, operation: Callable[[Catalogue], None], executed: bool
) -> None:
    """Every job is then in the same state under the same key."""
    undisturbed = prepared(make_catalogue())
    operation(undisturbed)
    work_off(undisturbed)
    number, kill = 0, Kill(0, executed)
    while number == 0 or kill.happened:
        catalogue, kill = prepared(make_catalogue()), Kill(number, executed)
        with monkeypatch.context() as patched, suppress(KeyboardInterrupt):
            patched.setattr(MongoConnection, "run", kill.run)
            operation(catalogue)
        operation(catalogue)
        work_off(catalogue)
        assert final_states(catalogue) == final_states(undisturbed), f"killed at request {number}"
        number += 1
    assert number > 8, "there were requests to kill"


def prepared(catalogue: Catalogue) -> Catalogue:
    catalogue.plan("town-a", pyramid(tracks=TRACK))
    work_off(catalogue)
    catalogue.announce("town-a", 1)
    return catalogue


def final_states(catalogue: Catalogue) -> list[tuple[object, ...]]:
    """Leaves out the number of attempts, which a kill during a lease changes."""
    return [(job.track, job.block, job.key, job.state, job.result) for job in catalogue.jobs("town-a")]


@pytest.mark.parametrize("way", ["stop", "kill"])
def test_server_that_ends_and_comes_back_costs_only_time(own_mongo_server: MongoProcess, way: str) -> None:
    catalogue = open_catalogue(f"{own_mongo_server.url}/town", lease_s=1)
    catalogue.create_scene(SceneRecord("town"))
    catalogue.create_rendering(rendering())
    jobs = [PlannedJob("0-45", BlockId(10, x, 0), "base", x, "k", None) for x in range(60)]
    catalogue.plan("town-a", jobs)
    errors: list[BaseException] = []
    threads = [threading.Thread(target=work, args=(catalogue, f"w{n}", errors)) for n in range(3)]
    for thread in threads:
        thread.start()
    for done in (10, 25, 40):
        while catalogue.count_jobs("town-a")[State.DONE] < done:
            assert not errors
        getattr(own_mongo_server, way)()
        own_mongo_server.start()
    for thread in threads:
        thread.join(60)
    assert not errors
    assert catalogue.count_jobs("town-a")[State.DONE] == len(jobs)
    assert all(job.result == RESULT for job in catalogue.jobs("town-a"))
    catalogue.close()


def work(catalogue: Catalogue, name: str, errors: list[BaseException]) -> None:
    try:
        while catalogue.has_open_jobs("town-a"):
            lease = catalogue.lease("town-a", name)
            if lease is not None:
                with suppress(StaleFence):
                    catalogue.done(lease, RESULT)
    except BaseException as error:
        errors.append(error)


def test_missing_server_is_reported_without_the_password(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mongodb_connection, "CONNECT_S", 0.1)
    monkeypatch.setattr(mongodb_connection, "_SELECTION_MS", 100)
    with pytest.raises(StoreError) as caught:
        open_catalogue("mongodb://me:s3cr3t@127.0.0.1:9/town")
    message = str(caught.value)
    assert message.startswith("mongodb://me:***@127.0.0.1:9/town: cannot reach the MongoDB server")
    assert "MAP3D_CATALOGUE" in message
    assert "s3cr3t" not in message


def test_server_that_is_away_for_too_long_is_reported(own_mongo_server: MongoProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mongodb_connection, "_SELECTION_MS", 200)
    catalogue = open_catalogue(f"{own_mongo_server.url}/town")
    own_mongo_server.stop()
    connection = catalogue._connection  # type: ignore[attr-defined]
    with pytest.raises(StoreError, match=r"/town: cannot reach the MongoDB server for 0 s .*start it"):
        connection.run(lambda _: connection.collection("scene").find_one({}), 0.0)
    catalogue.close()


@pytest.mark.parametrize("url", ["mongodb://127.0.0.1", "mongodb://127.0.0.1/", "mongodb://a:b:c3cret@h:x/db", "mongodb://u:c3cret/@h/db"])
def test_invalid_url_is_refused_without_its_password(url: str) -> None:
    with pytest.raises(BadRequest, match="mongodb://") as caught:
        open_catalogue(url)
    assert "c3cret" not in str(caught.value)
    assert caught.value.__cause__ is None


def test_catalogue_of_a_newer_version_is_refused(new_url: NewUrl, mongo_server: str) -> None:
    url = new_url()
    open_catalogue(url).close()
    with MongoClient[dict[str, object]](mongo_server) as client:
        client[url.rpartition("/")[2]]["meta"].update_one({"_id": "schema"}, {"$set": {"version": VERSION + 1}})
    with pytest.raises(UnknownVersion, match=f"version {VERSION + 1}; this map3d reads version {VERSION}"):
        open_catalogue(url)


def test_an_unfinished_rendering_of_version_1_resumes(new_url: NewUrl, mongo_server: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Version 1 had no Hilbert indices. The migration is repeated, as after a kill."""
    monkeypatch.setattr(mongodb_connection, "MIGRATED_BATCH", 3)
    url = new_url()
    catalogue = open_catalogue(url)
    catalogue.create_scene(SceneRecord("town"))
    catalogue.create_rendering(rendering())
    catalogue.plan("town-a", pyramid())
    lease = catalogue.lease("town-a", "w")
    assert lease is not None
    catalogue.done(lease, RESULT)
    before = described(catalogue)
    catalogue.close()
    former = ["rendering", "state", "tries", "z", "track", "morton"]
    with MongoClient[dict[str, object]](mongo_server) as client:
        database = client[url.rpartition("/")[2]]
        database["job"].update_many({}, {"$unset": {"ground": ""}})
        database["job"].create_index([(name, 1) for name in former])
        for _ in range(2):
            database["meta"].update_one({"_id": "schema"}, {"$set": {"version": 1}})
            open_catalogue(url).close()
        assert former not in [list(index["key"]) for index in database["job"].list_indexes()]
    catalogue = open_catalogue(url)
    assert described(catalogue) == before
    assert {job.block.x: job.ground for job in catalogue.jobs("town-a", TRACKS[0]) if job.kind == "base"} == {0: 0, 4: 16, 8: 32, 12: 48}
    work_off(catalogue)
    assert set(catalogue.count_jobs("town-a").items()) >= {(State.DONE, len(before)), (State.TODO, 0), (State.WAITING, 0)}
    catalogue.close()


def test_older_catalogue_is_migrated_once(new_url: NewUrl, monkeypatch: pytest.MonkeyPatch) -> None:
    url, migrated = new_url(), []
    open_catalogue(url).close()
    monkeypatch.setattr(mongodb_connection, "VERSION", VERSION + 2)
    with pytest.raises(UnknownVersion):
        open_catalogue(url)
    migrations = {version: lambda database, version=version: migrated.append(version) for version in (VERSION + 1, VERSION + 2)}
    monkeypatch.setattr(mongodb_connection, "MIGRATIONS", migrations)
    for _ in range(2):
        open_catalogue(url).close()
    assert migrated == [VERSION + 1, VERSION + 2]


def test_indexes_support_the_frequent_queries(new_url: NewUrl, mongo_server: str) -> None:
    url = new_url()
    open_catalogue(url).close()
    with MongoClient[dict[str, object]](mongo_server) as client:
        found = [list(index["key"]) for index in client[url.rpartition("/")[2]]["job"].list_indexes()]
    assert ["rendering", "state", "tries", "z", "ground", "track", "morton"] in found
    assert ["parent", "state"] in found


def test_results_keep_all_64_bits(new_url: NewUrl) -> None:
    catalogue = open_catalogue(new_url())
    catalogue.create_scene(SceneRecord("town"))
    catalogue.create_rendering(rendering())
    catalogue.plan("town-a", pyramid(tracks=TRACK))
    results = [JobResult(1, False, occupied=bits) for bits in (0, 1 << 63, (1 << 64) - 1, None)]
    for result in results:
        lease = catalogue.lease("town-a", "w", 1)
        while lease is not None and lease.kind == "reduce":
            catalogue.done(lease, RESULT)
            lease = catalogue.lease("town-a", "w", 1)
        assert lease is not None
        catalogue.done(lease, result)
    stored = {job.result for job in catalogue.jobs("town-a", state=State.DONE) if job.kind == "base"}
    assert stored == set(results)
    catalogue.close()


def test_missing_driver_is_named_with_the_command_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("map3d.catalogue.mongodb")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pymongo", None)
    with pytest.raises(BadRequest, match=r"pip install 'map3d\[mongodb\]'"):
        open_catalogue("mongodb://127.0.0.1/town")


def test_driver_is_imported_only_for_mongodb() -> None:
    program = "import sys, map3d.catalogue, map3d.cli.app; sys.exit('pymongo' in sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True)
