"""The conversation between parent and child."""

import os
import threading

import pytest

from map3d.errors import ChildDied, Corrupt
from map3d.subprocess import Channel, Child, Message
from map3d.subprocess.channel import MAX_JSON_BYTES

ECHO = "tests.subprocess.echo:open_echo"


def pipe() -> tuple[Channel, int]:
    """A channel that reads what is written to the descriptor."""
    read, write = os.pipe()
    return Channel(read, -1), write


@pytest.mark.parametrize("sizes", [[], [0], [1], [0, 0, 5], [100_000, 0, 3_000_000], list(range(200))])
def test_what_is_sent_arrives(sizes: list[int]) -> None:
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


def test_half_a_message_is_no_message() -> None:
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
def test_nonsense_is_refused(data: bytes) -> None:
    channel, write = pipe()
    os.write(write, data)
    with pytest.raises(Corrupt):
        channel.receive(1)
    os.close(write)
    channel.close()


def test_a_child_answers_one_question_after_another() -> None:
    child = Child(ECHO, {"a": 1})
    child.wait_ready(30)
    pids = set()
    for sizes in ([], [1, 2], [2_000_000]):
        answer = child.ask({"sizes": sizes, "print": True}, wall_s=30)
        assert isinstance(answer, Message)
        assert answer.value["setup"] == {"a": 1}
        assert [len(blob) for blob in answer.blobs] == sizes
        pids.add(answer.value["pid"])
    assert pids == {child.pid}
    child.close()
    child.close()


def test_what_a_child_tells_on_the_way_is_heard() -> None:
    child = Child(ECHO, {})
    child.wait_ready(30)
    told: list[object] = []
    child.ask({"tell": 5}, wall_s=30, meanwhile=told.append)
    child.close()
    assert [item for item in told if item is not None] == [0, 1, 2, 3, 4]


def test_an_exception_of_the_listener_kills_the_child_and_goes_on() -> None:
    child = Child(ECHO, {})
    child.wait_ready(30)

    def object_to(told: object) -> None:
        raise KeyError(told)

    with pytest.raises(KeyError):
        child.ask({"tell": 5}, wall_s=30, meanwhile=object_to)
    with pytest.raises(ChildDied):
        child.ask({}, wall_s=30)
    child.close()


@pytest.mark.parametrize(
    ("entry", "says"),
    [("tests.subprocess.echo:open_broken", "cannot open"), ("tests.subprocess.nothing:x", "nothing"), ("tests.subprocess.echo:x", "x")],
)
def test_a_child_that_cannot_start_says_why(entry: str, says: str) -> None:
    child = Child(entry, {})
    with pytest.raises(ChildDied, match=says):
        child.wait_ready(30)
    child.close()
