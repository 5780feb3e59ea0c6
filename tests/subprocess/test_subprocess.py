"""Requests and responses between a process and its subprocess."""

import os
import signal
import threading

import pytest

from map3d.errors import Corrupt, SubprocessDied, SubprocessTimedOut
from map3d.subprocess import Channel, Message, Subprocess
from map3d.subprocess.channel import MAX_JSON_BYTES

ECHO = "tests.subprocess.echo:open_echo"


def pipe() -> tuple[Channel, int]:
    """Returns a channel and the descriptor that it reads from."""
    read, write = os.pipe()
    return Channel(read, -1), write


@pytest.mark.parametrize("sizes", [[], [0], [1], [0, 0, 5], [100_000, 0, 3_000_000], list(range(200))])
def test_sent_messages_arrive(sizes: list[int]) -> None:
    read, write = os.pipe()
    sender, receiver = Channel(-1, write), Channel(read, -1)
    blobs = [os.urandom(size) for size in sizes]
    thread = threading.Thread(target=lambda: [sender.send({"n": k, "text": "ä\ud800"}, blobs) for k in range(3)])
    thread.start()
    for k in range(3):
        message = receiver.receive(10)
        assert message is not None
        assert message.value["n"] == k
        assert message.blobs == blobs
    thread.join()
    sender.close()
    with pytest.raises(EOFError):
        receiver.receive(1)
    receiver.close()


def test_incomplete_message_is_not_returned() -> None:
    channel, write = pipe()
    os.write(write, b"\x02\0\0\0")
    assert channel.receive(0.05) is None
    os.write(write, b"\0\0\0\0\0\0\0\0{")
    assert channel.receive(0.05) is None
    os.close(write)
    with pytest.raises(EOFError):
        channel.receive(1)
    channel.close()


@pytest.mark.parametrize(
    "data",
    [
        b"\xff" * 64,
        (MAX_JSON_BYTES + 1).to_bytes(4, "little") + bytes(8),
        b"\x02\0\0\0" + bytes(8) + b"[]",
        b"\x02\0\0\0" + bytes(8) + b"{}",
        b"\x03\0\0\0" + bytes(8) + b"{a}",
        b"\x0d\0\0\0" + bytes(8) + b'{"blobs":[5]}',
        b"\x0f\0\0\0" + bytes(8) + b'{"blobs":["x"]}',
    ],
)
def test_invalid_message_is_refused(data: bytes) -> None:
    channel, write = pipe()
    os.write(write, data)
    with pytest.raises(Corrupt):
        channel.receive(1)
    os.close(write)
    channel.close()


def test_subprocess_handles_one_request_after_another() -> None:
    process = Subprocess(ECHO, {"a": 1})
    process.wait_ready(30)
    pids = set()
    for sizes in ([], [1, 2], [2_000_000]):
        response = process.request({"sizes": sizes, "print": True}, wall_s=30)
        assert isinstance(response, Message)
        assert response.value["setup"] == {"a": 1}
        assert [len(blob) for blob in response.blobs] == sizes
        pids.add(response.value["pid"])
    assert pids == {process.pid}
    process.close()
    process.close()


def test_requests_carry_byte_strings() -> None:
    process = Subprocess(ECHO, {})
    process.wait_ready(30)
    for blobs in ([b"one", b""], [os.urandom(9_000_000), b"x"]):
        response = process.request(Message({"echo": True}, blobs), wall_s=30)
        assert isinstance(response, Message)
        assert response.blobs == blobs
    process.close()


def test_a_subprocess_that_does_not_read_its_request_is_killed_in_time() -> None:
    process = Subprocess(ECHO, {})
    process.wait_ready(30)
    os.kill(process.pid, signal.SIGSTOP)
    reports: list[object] = []
    with pytest.raises(SubprocessTimedOut, match="did not read"):
        process.request(Message({}, [bytes(9_000_000)]), wall_s=0.5, every_s=0.05, on_progress=reports.append)
    assert reports
    with pytest.raises(SubprocessDied):
        process.request({}, wall_s=30)
    process.close()


def test_progress_reports_arrive_before_the_response() -> None:
    process = Subprocess(ECHO, {})
    process.wait_ready(30)
    reports: list[object] = []
    process.request({"reports": 5}, wall_s=30, on_progress=reports.append)
    process.close()
    assert [item for item in reports if item is not None] == [0, 1, 2, 3, 4]


def test_exception_in_on_progress_kills_the_subprocess_and_propagates() -> None:
    process = Subprocess(ECHO, {})
    process.wait_ready(30)

    def fail(progress: object) -> None:
        raise KeyError(progress)

    with pytest.raises(KeyError):
        process.request({"reports": 5}, wall_s=30, on_progress=fail)
    with pytest.raises(SubprocessDied):
        process.request({}, wall_s=30)
    process.close()


@pytest.mark.parametrize(
    ("entry", "says"),
    [("tests.subprocess.echo:open_broken", "cannot open"), ("tests.subprocess.nothing:x", "nothing"), ("tests.subprocess.echo:x", "x")],
)
def test_failed_start_says_why(entry: str, says: str) -> None:
    process = Subprocess(entry, {})
    with pytest.raises(SubprocessDied, match=says):
        process.wait_ready(30)
    process.close()
