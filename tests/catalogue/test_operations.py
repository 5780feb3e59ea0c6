"""Laws of operations: states, leases, progress, logs (spec/catalogue.md)."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from map3d.catalogue import Catalogue, OperationLease, OperationRecord, OperationState, SceneRecord, operation_records
from map3d.catalogue.states import MAX_EXPIRIES
from map3d.errors import BadRequest, LimitExceeded, NotFound, StaleFence
from map3d.messages import Message, message, verbatim
from tests.catalogue.implementations import LEASE_S, rendering

WAITING, RUNNING, DONE, FAILED, CANCELLED = OperationState


def ask(catalogue: Catalogue, kind: str = "build", target: str = "town") -> OperationRecord:
    return catalogue.create_operation(kind, target, {"files": ["a"]}, "anna")


def take(catalogue: Catalogue, worker: str = "w") -> OperationLease:
    lease = catalogue.lease_operation(worker)
    assert lease is not None
    return lease


def other_scene(catalogue: Catalogue) -> None:
    catalogue.create_scene(SceneRecord("village"))
    catalogue.create_rendering(replace(rendering("village-a"), scene="village"))


def said(*texts: str) -> list[Message]:
    return list(map(verbatim, texts))


def texts(catalogue: Catalogue, id: str, after: int = 0) -> list[str]:
    return [str(line.text) for line in catalogue.operation_log(id, after)]


def test_new_operation_waits_and_is_stored(catalogue: Catalogue) -> None:
    asked = ask(catalogue, "render", "town-a")
    assert asked == catalogue.operation(asked.id)
    assert (asked.kind, asked.target, asked.scene, asked.state, asked.asked_by) == ("render", "town-a", "town", WAITING, "anna")
    assert asked.arguments == {"files": ["a"]}
    assert (asked.stage, asked.done, asked.total, asked.message, asked.started, asked.ended, asked.worker) == (None, 0, 0, None, None, None, None)
    assert abs(asked.created.timestamp() - catalogue.clock_s()) < 60
    assert asked.created.tzinfo == UTC or asked.created.utcoffset() == datetime.now(UTC).utcoffset()
    assert catalogue.operation_log(asked.id) == []


def test_target_of_an_operation_must_exist(catalogue: Catalogue) -> None:
    for kind, target in [("build", "town-a"), ("import", "nowhere"), ("render", "town"), ("publish", "town"), ("remove", "town-a")]:
        with pytest.raises(NotFound, match=f"no (scene|rendering) '{target}'"):
            catalogue.create_operation(kind, target, {}, "anna")
    removal = catalogue.create_operation("remove", "town-a", {"what": "rendering"}, "anna")
    assert removal.scene == "town"


@pytest.mark.parametrize("arguments", [{"number": float("nan")}, {"bytes": b"x"}, {"set": {1}}])
def test_arguments_that_are_not_json_are_refused(catalogue: Catalogue, arguments: dict[str, object]) -> None:
    with pytest.raises(BadRequest, match="not JSON"):
        catalogue.create_operation("build", "town", arguments, "anna")


def test_arguments_are_limited(catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operation_records, "MAX_ARGUMENTS_BYTES", len('{"a": "bcd"}'))
    catalogue.create_operation("build", "town", {"a": "bcd"}, "anna")
    with pytest.raises(LimitExceeded, match="arguments have 13 bytes, at most 12"):
        catalogue.create_operation("build", "town", {"a": "bcde"}, "anna")


def test_unknown_kind_is_refused(catalogue: Catalogue) -> None:
    with pytest.raises(BadRequest, match="unknown kind; use import, build, render, publish, remove"):
        ask(catalogue, "destroy")


@pytest.mark.parametrize("id", ["0", "7", "-1", "", "x", "1.0", "١", " 1", "9" * 15, "9" * 400])
def test_unknown_id_is_not_found(catalogue: Catalogue, id: str) -> None:
    for call in (catalogue.operation, catalogue.operation_log, catalogue.cancel_operation, catalogue.retry_operation):
        with pytest.raises(NotFound, match="no operation"):
            call(id)


def test_operations_are_listed_newest_first_and_selected(catalogue: Catalogue) -> None:
    other_scene(catalogue)
    targets = [("build", "town"), ("render", "town-a"), ("build", "village"), ("render", "village-a"), ("build", "town")]
    ids = [ask(catalogue, kind, target).id for kind, target in targets]
    first = take(catalogue)

    def listed(*arguments: object, **more: object) -> list[int]:
        return [ids.index(item.id) for item in catalogue.operations(*arguments, **more)]  # type: ignore[arg-type]

    assert listed() == [4, 3, 2, 1, 0]
    assert listed("town") == [4, 0]
    assert listed(scene="town") == [4, 1, 0]
    assert listed(states=[WAITING]) == [4, 3, 2, 1]
    assert listed(None, [RUNNING]) == [ids.index(first.operation.id)] == [0]
    assert listed(states=[]) == []
    assert listed(limit=2) == [4, 3]
    assert listed(limit=2, before=ids[3]) == [2, 1]
    assert listed("nowhere") == []


def test_operations_are_leased_in_the_order_of_their_creation(catalogue: Catalogue) -> None:
    ids = [ask(catalogue).id for _ in range(3)]
    for id in ids:
        lease = take(catalogue)
        assert (lease.operation.id, lease.operation.state, lease.operation.worker) == (id, RUNNING, "w")
        assert lease.operation.started is not None
        catalogue.end_operation(lease, DONE, verbatim("imported 3 files"))
        ended = catalogue.operation(id)
        assert (ended.state, ended.message, ended.worker) == (DONE, verbatim("imported 3 files"), None)
        assert ended.ended is not None
        assert ended.created <= lease.operation.started <= ended.ended
    assert catalogue.lease_operation("w") is None


def test_two_operations_of_one_scene_never_run_at_the_same_time(catalogue: Catalogue) -> None:
    other_scene(catalogue)
    first, second, third = ask(catalogue), ask(catalogue, "render", "town-a"), ask(catalogue, "publish", "village-a")
    running = take(catalogue)
    assert running.operation.id == first.id
    assert take(catalogue, "other").operation.id == third.id
    assert catalogue.lease_operation("third") is None
    catalogue.end_operation(running, FAILED, verbatim("no"))
    assert take(catalogue, "third").operation.id == second.id


def test_progress_is_stored(catalogue: Catalogue) -> None:
    lease = take_new(catalogue)
    assert catalogue.heartbeat_operation(lease, verbatim("rendering"), 3, 12)
    found = catalogue.operation(lease.operation.id)
    assert (found.stage, found.done, found.total, found.state) == (verbatim("rendering"), 3, 12, RUNNING)


def take_new(catalogue: Catalogue) -> OperationLease:
    ask(catalogue)
    return take(catalogue)


def test_lines_of_the_log_are_numbered_and_timed(catalogue: Catalogue) -> None:
    lease = take_new(catalogue)
    before_s = catalogue.clock_s()
    catalogue.append_log(lease, said("one", "two\nthree"))
    catalogue.append_log(lease, [])
    catalogue.append_log(lease, said("", "five"))
    lines = catalogue.operation_log(lease.operation.id)
    assert [(line.number, str(line.text)) for line in lines] == [(1, "one"), (2, "two"), (3, "three"), (4, ""), (5, "five")]
    assert before_s - 0.01 <= lines[0].time.timestamp() <= catalogue.clock_s() + 0.01
    assert texts(catalogue, lease.operation.id, 3) == ["", "five"]
    assert [str(line.text) for line in catalogue.operation_log(lease.operation.id, 1, limit=2)] == ["two", "three"]


@pytest.mark.parametrize("batches", [[20], [10, 10], [3] * 6 + [2], [1] * 20])
def test_log_is_cut_in_the_middle(catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch, batches: Sequence[int]) -> None:
    monkeypatch.setattr(operation_records, "MAX_LOG_LINES", 10)
    lease = take_new(catalogue)
    lines = [f"line {number}" for number in range(1, 21)]
    for batch in batches:
        catalogue.append_log(lease, said(*lines[:batch]))
        lines = lines[batch:]
    id = lease.operation.id
    kept = [f"line {number}" for number in (*range(1, 6), *range(16, 21))]
    assert texts(catalogue, id) == [*kept[:5], "… 10 lines are not kept …", *kept[5:]]
    assert texts(catalogue, id, 15) == kept[5:], "the note is not repeated"
    assert texts(catalogue, id, 12) == ["… 3 lines are not kept …", *kept[5:]]


def test_log_below_its_limit_is_whole(catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operation_records, "MAX_LOG_LINES", 10)
    lease = take_new(catalogue)
    catalogue.append_log(lease, said(*map(str, range(10))))
    assert texts(catalogue, lease.operation.id) == [str(number) for number in range(10)]


def test_long_line_is_cut(catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operation_records, "MAX_LINE_CHARACTERS", 5)
    lease = take_new(catalogue)
    catalogue.append_log(lease, said("12345", "123456"))
    assert texts(catalogue, lease.operation.id) == ["12345", "1234…"]


def test_waiting_operation_is_cancelled_at_once(catalogue: Catalogue) -> None:
    id = ask(catalogue).id
    for _ in range(2):
        cancelled = catalogue.cancel_operation(id)
        assert (cancelled.state, cancelled.message, cancelled.cancelling) == (CANCELLED, message("cancelled"), False)
        assert cancelled.ended is not None
    assert catalogue.lease_operation("w") is None


def test_worker_of_a_cancelled_operation_is_told_and_ends_it(catalogue: Catalogue) -> None:
    lease = take_new(catalogue)
    waiting = ask(catalogue)
    for _ in range(2):
        cancelled = catalogue.cancel_operation(lease.operation.id)
        assert (cancelled.state, cancelled.cancelling) == (RUNNING, True)
    assert not catalogue.heartbeat_operation(lease, verbatim("building"), 1, 2)
    assert catalogue.lease_operation("other") is None, "its scene is not free yet"
    catalogue.append_log(lease, said("stopping"))
    catalogue.end_operation(lease, CANCELLED, verbatim("cancelled while building"))
    ended = catalogue.operation(lease.operation.id)
    assert (ended.state, ended.cancelling, ended.message) == (CANCELLED, False, verbatim("cancelled while building"))
    assert take(catalogue).operation.id == waiting.id


def test_operation_that_ends_before_its_worker_hears_of_the_cancellation_is_done(catalogue: Catalogue) -> None:
    lease = take_new(catalogue)
    catalogue.cancel_operation(lease.operation.id)
    catalogue.end_operation(lease, DONE)
    assert catalogue.operation(lease.operation.id).state is DONE


@pytest.mark.parametrize("state", [DONE, FAILED])
def test_ended_operation_cannot_be_cancelled(catalogue: Catalogue, state: OperationState) -> None:
    lease = take_new(catalogue)
    catalogue.end_operation(lease, state)
    with pytest.raises(BadRequest, match=f"is {state} and cannot be cancelled"):
        catalogue.cancel_operation(lease.operation.id)


@pytest.mark.parametrize("state", [FAILED, CANCELLED])
def test_failed_and_cancelled_operations_are_retried(catalogue: Catalogue, state: OperationState) -> None:
    lease = take_new(catalogue)
    catalogue.heartbeat_operation(lease, verbatim("reading"), 1, 2)
    catalogue.append_log(lease, said("first attempt"))
    catalogue.end_operation(lease, state, verbatim("why"))
    again = catalogue.retry_operation(lease.operation.id)
    assert (again.state, again.message, again.stage, again.done, again.started, again.ended) == (WAITING, None, None, 0, None, None)
    with pytest.raises(BadRequest, match="is waiting; only failed and cancelled"):
        catalogue.retry_operation(again.id)
    second = take(catalogue)
    with pytest.raises(StaleFence):
        catalogue.end_operation(lease, DONE)
    catalogue.append_log(second, said("second attempt"))
    catalogue.end_operation(second, DONE)
    assert texts(catalogue, again.id) == ["first attempt", "second attempt"]
    with pytest.raises(BadRequest, match="is done; only failed and cancelled"):
        catalogue.retry_operation(again.id)


def test_released_operation_waits_again_and_keeps_its_place(catalogue: Catalogue) -> None:
    lease = take_new(catalogue)
    later = ask(catalogue)
    catalogue.release_operation(lease)
    assert catalogue.operation(lease.operation.id).state is WAITING
    again = take(catalogue)
    assert (again.operation.id, again.operation.started) == (lease.operation.id, lease.operation.started)
    assert later.id > again.operation.id
    for call in CALLS.values():
        with pytest.raises(StaleFence):
            call(catalogue, lease)
    assert not catalogue.heartbeat_operation(lease, verbatim(""), 0, 0)


def test_cancelled_operation_that_is_released_ends(catalogue: Catalogue) -> None:
    lease = take_new(catalogue)
    catalogue.cancel_operation(lease.operation.id)
    catalogue.release_operation(lease)
    assert catalogue.operation(lease.operation.id).state is CANCELLED
    assert catalogue.lease_operation("w") is None


CALLS: dict[str, Callable[[Catalogue, OperationLease], None]] = {
    "log": lambda catalogue, lease: catalogue.append_log(lease, said("x")),
    "end": lambda catalogue, lease: catalogue.end_operation(lease, DONE),
    "release": lambda catalogue, lease: catalogue.release_operation(lease),
}


def test_operation_of_a_killed_worker_is_leased_again(brief_catalogue: Catalogue) -> None:
    first = take_new(brief_catalogue)
    assert brief_catalogue.lease_operation("other") is None
    time.sleep(LEASE_S + 0.1)
    second = take(brief_catalogue, "other")
    assert (second.operation.id, second.operation.worker) == (first.operation.id, "other")
    assert second.fence > first.fence
    assert not brief_catalogue.heartbeat_operation(first, verbatim("late"), 1, 1)
    for call in CALLS.values():
        with pytest.raises(StaleFence):
            call(brief_catalogue, first)
    assert brief_catalogue.operation(first.operation.id).stage is None


def test_heartbeats_renew_the_lease_of_an_operation(brief_catalogue: Catalogue) -> None:
    lease = take_new(brief_catalogue)
    for step in range(6):
        time.sleep(LEASE_S / 4)
        assert brief_catalogue.heartbeat_operation(lease, verbatim("building"), step, 6)
        assert brief_catalogue.lease_operation("other") is None
    brief_catalogue.end_operation(lease, DONE)


def test_overdue_lease_is_refused_even_when_the_operation_is_free(brief_catalogue: Catalogue) -> None:
    lease = take_new(brief_catalogue)
    time.sleep(LEASE_S + 0.1)
    assert not brief_catalogue.heartbeat_operation(lease, verbatim("late"), 1, 1)
    with pytest.raises(StaleFence):
        brief_catalogue.end_operation(lease, DONE)


def test_cancelling_an_operation_whose_worker_was_killed_ends_it(brief_catalogue: Catalogue) -> None:
    lease = take_new(brief_catalogue)
    time.sleep(LEASE_S + 0.1)
    assert brief_catalogue.cancel_operation(lease.operation.id).state is CANCELLED


def test_cancelled_operation_of_a_worker_that_is_killed_meanwhile_ends(catalogue: Catalogue) -> None:
    lease = take_new(catalogue)
    catalogue.cancel_operation(lease.operation.id)
    assert catalogue.expire_operations(["w"]) == 1
    assert catalogue.lease_operation("other") is None
    assert catalogue.operation(lease.operation.id).state is CANCELLED


def test_only_operations_of_the_named_workers_expire(catalogue: Catalogue) -> None:
    other_scene(catalogue)
    ask(catalogue), ask(catalogue, target="village")
    mine, others = take(catalogue), take(catalogue, "other")
    assert catalogue.expire_operations(["w", "unknown"]) == 1
    assert not catalogue.heartbeat_operation(mine, verbatim(""), 0, 0)
    assert catalogue.heartbeat_operation(others, verbatim(""), 0, 0)
    assert take(catalogue, "third").operation.id == mine.operation.id


def test_operation_that_always_loses_its_worker_fails(catalogue: Catalogue) -> None:
    id = ask(catalogue).id
    for _ in range(MAX_EXPIRIES):
        assert take(catalogue).operation.id == id
        assert catalogue.expire_operations(["w"]) == 1
    assert catalogue.lease_operation("w") is None
    failed = catalogue.operation(id)
    assert (failed.state, failed.message) == (FAILED, message("worker-ended", count=MAX_EXPIRIES))
    catalogue.retry_operation(id)
    take(catalogue)
    catalogue.expire_operations(["w"])
    assert take(catalogue).operation.id == id, "a retry counts from 0"


def test_end_may_be_repeated(catalogue: Catalogue) -> None:
    lease = take_new(catalogue)
    for _ in range(2):
        catalogue.end_operation(lease, DONE, verbatim("fine"))
    with pytest.raises(StaleFence):
        catalogue.end_operation(lease, FAILED)


def test_oldest_ended_operations_are_removed_with_their_logs(catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operation_records, "MAX_ENDED", 2)
    other_scene(catalogue)
    waiting = ask(catalogue, target="village").id
    held = take(catalogue, "other")
    ids = []
    for _ in range(4):
        lease = take_new(catalogue)
        catalogue.append_log(lease, said("text"))
        catalogue.end_operation(lease, DONE)
        ids.append(lease.operation.id)
    last = ask(catalogue).id
    assert [item.id for item in catalogue.operations()] == [last, ids[3], ids[2], waiting]
    with pytest.raises(NotFound):
        catalogue.operation_log(ids[0])
    assert texts(catalogue, ids[2]) == ["text"]
    assert catalogue.heartbeat_operation(held, verbatim(""), 0, 0), "only ended operations are removed"


def test_ids_are_never_used_again(catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operation_records, "MAX_ENDED", 0)
    ids = []
    for _ in range(3):
        ids.append(ask(catalogue).id)
        with suppress(NotFound):
            catalogue.cancel_operation(ids[-1])
    assert len(set(ids)) == 3


def test_operations_outlive_their_scene(catalogue: Catalogue) -> None:
    lease_id = catalogue.create_operation("remove", "town-a", {"what": "rendering"}, "anna").id
    lease = take(catalogue)
    catalogue.remove_rendering("town-a")
    catalogue.remove_scene("town")
    catalogue.end_operation(lease, DONE)
    assert catalogue.operation(lease_id).state is DONE
