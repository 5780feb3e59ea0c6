"""The records of operations: long pieces of work that a person or a program asked for and that an operation worker does (spec/catalogue.md)."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from typing import Any, Final

from map3d.errors import BadRequest, LimitExceeded, NotFound
from map3d.messages import Message, dump_text, message, verbatim

OPERATION_KINDS: Final = ("import", "build", "render", "publish", "remove")
MAX_ARGUMENTS_BYTES: Final = 1 << 20
MAX_LOG_LINES: Final = 10_000
"""Lines that the log of one operation keeps: the first half of them and the latest half."""
MAX_LINE_CHARACTERS: Final = 2_000
"""Characters of each text in a line."""
MAX_ENDED: Final = 1_000
"""Ended operations that the catalogue keeps; older ones are removed with their logs when another operation is created."""
_LONGEST_ID: Final = 15


class OperationState(StrEnum):
    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


UNENDED: Final = (OperationState.WAITING, OperationState.RUNNING)
ENDED: Final = (OperationState.DONE, OperationState.FAILED, OperationState.CANCELLED)
REPEATABLE: Final = (OperationState.FAILED, OperationState.CANCELLED)


@dataclass(frozen=True)
class OperationRecord:
    """`target`: name of a scene or, for render, publish and the removal of a rendering, of a rendering; `scene`: the scene that it changes or reads.
    `done` of `total` steps of `stage`; a `total` of 0 is unknown. `message`: how the operation ended. Times are UTC on the database's clock.

    `cancelling`: a running operation was cancelled, and its worker has not stopped it yet.
    """

    id: str
    kind: str
    target: str
    arguments: Mapping[str, Any]
    state: OperationState
    stage: Message | None
    done: int
    total: int
    message: Message | None
    asked_by: str
    created: datetime
    started: datetime | None = None
    ended: datetime | None = None
    scene: str = ""
    worker: str | None = None
    cancelling: bool = False


@dataclass(frozen=True)
class OperationLease:
    """A worker's claim on an operation. Every later call about the operation passes `fence`."""

    operation: OperationRecord
    worker: str
    fence: int


@dataclass(frozen=True)
class LogLine:
    """Lines of one operation are numbered from 1."""

    number: int
    time: datetime
    text: Message


@dataclass(frozen=True)
class NewOperation:
    """A checked request for an operation. Raises BadRequest for an unknown kind or arguments that are not JSON, LimitExceeded for too long ones."""

    kind: str
    target: str
    arguments: Mapping[str, Any]
    asked_by: str
    arguments_json: str = field(init=False)

    def __post_init__(self) -> None:
        if self.kind not in OPERATION_KINDS:
            raise BadRequest(f"operation {self.kind!r}: unknown kind; use {', '.join(OPERATION_KINDS)}")
        try:
            text = json.dumps(dict(self.arguments), allow_nan=False)
        except (TypeError, ValueError) as error:
            raise BadRequest(f"operation {self.kind} {self.target}: arguments are not JSON: {error}") from error
        if len(text) > MAX_ARGUMENTS_BYTES:
            raise LimitExceeded(
                f"operation {self.kind} {self.target}: arguments have {len(text):,} bytes, at most {MAX_ARGUMENTS_BYTES:,} are allowed; "
                "divide the work into several operations"
            )
        object.__setattr__(self, "arguments_json", text)

    @property
    def is_on_rendering(self) -> bool:
        """Whether `target` is the name of a rendering and not of a scene."""
        return self.kind in ("render", "publish") or (self.kind == "remove" and self.arguments.get("what") in ("rendering", "published"))


def operation_number(id: str) -> int:
    """Returns the number in an operation's id. Raises NotFound for text that is not an id."""
    if not (id.isascii() and id.isdecimal() and len(id) <= _LONGEST_ID):
        raise NotFound(f"no operation {id[:64]!r}; map3d operations lists them")
    return int(id)


CANCELLED_MESSAGE: Final = dump_text(Message("cancelled"))
"""How an operation ends that was cancelled before it ran."""


def log_texts(lines: Iterable[Message]) -> list[str]:
    """Returns the lines as the log stores them: one line each, their texts cut where they are too long."""
    return [dump_text(part.map_texts(_one_line)) for line in lines for part in _single(line)]


def _single(line: Message) -> list[Message]:
    return [verbatim(text) for text in str(line).splitlines() or [""]] if line.code == "verbatim" else [line]


def _one_line(text: str) -> str:
    single = " ".join(text.splitlines())
    return single if len(single) <= MAX_LINE_CHARACTERS else single[: MAX_LINE_CHARACTERS - 1] + "…"


def with_gaps(lines: Sequence[LogLine], after: int) -> list[LogLine]:
    """Returns the lines with a note wherever lines were removed. `after`: number of the line before the first."""
    noted = []
    for line in lines:
        if line.number > after + 1:
            noted.append(LogLine(line.number - 1, line.time, message("log-lines-left-out", count=line.number - after - 1)))
        noted.append(line)
        after = line.number
    return noted


def unretryable(operation: OperationRecord) -> BadRequest:
    return BadRequest(f"operation {operation.id}: is {operation.state}; only failed and cancelled operations can be retried")


def uncancellable(operation: OperationRecord) -> BadRequest:
    return BadRequest(f"operation {operation.id}: is {operation.state} and cannot be cancelled; only waiting and running operations can")


def expiry_message(expiries: int) -> str:
    """Returns the message as the catalogue stores it."""
    return dump_text(Message("worker-ended", {"count": expiries}))
