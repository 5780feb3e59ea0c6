"""Operations as pages show them."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from map3d.catalogue import OperationRecord
from map3d.catalogue.operation_records import REPEATABLE, UNENDED
from map3d.messages import Message
from map3d.web.http.host_folders import without_host_folders
from map3d.web.pages.language import language
from map3d.web.pages.tools import translate as _

N_: Final = str
KINDS: Final = {"import": N_("Import"), "build": N_("Build"), "render": N_("Render"), "publish": N_("Publish"), "remove": N_("Remove")}
STATES: Final = {"waiting": N_("Waiting"), "running": N_("Running"), "done": N_("Done"), "failed": N_("Failed"), "cancelled": N_("Cancelled")}


@dataclass(frozen=True)
class ShownOperation:
    """`percent`: None while it is unknown."""

    id: str
    title: str
    state: str
    state_text: str
    text: str
    percent: int | None
    record: OperationRecord

    @property
    def is_open(self) -> bool:
        return self.record.state in UNENDED

    @property
    def lacks_crs(self) -> bool:
        """Whether an import failed for its coordinate systems, so that another one may help."""
        said = self.record.message
        is_crs = said is not None and not said.codes.isdisjoint(("crs-missing", "crs-unusable"))
        return self.record.kind == "import" and self.can_retry and is_crs and bool(self.record.arguments.get("files"))

    @property
    def can_retry(self) -> bool:
        return self.record.state in REPEATABLE


def message_text(message: Message | None) -> str:
    """Returns a message in the language of the page, without the folders of the server's host."""
    return "" if message is None else message.map_texts(without_host_folders).text(language())


def show(operation: OperationRecord) -> ShownOperation:
    state = str(operation.state)
    state_text = _("Stopping") if operation.cancelling else _(STATES[state])
    percent = min(100, 100 * operation.done // operation.total) if operation.total and state == "running" else None
    said = operation.stage if state == "running" else operation.message
    text = _("Starts when a worker is free.") if state == "waiting" else message_text(said)
    return ShownOperation(operation.id, f"{_(KINDS[operation.kind])}: {operation.target}", state, state_text, text, percent, operation)


def show_all(operations: Iterable[OperationRecord]) -> list[ShownOperation]:
    return [show(operation) for operation in operations]
