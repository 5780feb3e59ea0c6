"""What the pages of the web interface share."""

from collections.abc import Sequence
from typing import Any

from starlette.responses import Response

from map3d.catalogue import OperationRecord
from map3d.errors import BadRequest
from map3d.operations.request_operation import request_operation
from map3d.publish.published_folders import PublishedFolder
from map3d.web.http.current import catalogue, request, workspace
from map3d.web.http.guards import require
from map3d.web.http.host_folders import without_host_folders
from map3d.web.http.responses import redirect, uncached
from map3d.web.pages.tools import relative, render, translate


def page(template: str, status: int = 200, **values: Any) -> Response:
    """Returns a page that is never cached."""
    if "problem" in values:
        values["problem"] = without_host_folders(values["problem"])
    return uncached(render(f"studio/{template}", **values), status)


def go_to(path: str) -> Response:
    """Redirects to a page of the web interface after a form was accepted."""
    return redirect(relative(path))


def ask(kind: str, target: str, **arguments: Any) -> OperationRecord:
    """Asks for an operation in the name of the signed-in user."""
    return request_operation(workspace(), catalogue(), kind, target, arguments, require("editor").user)


def folder_choice(folders: Sequence[PublishedFolder]) -> dict[str, Any]:
    """Returns what a removal's page needs to let people choose published folders: all of them, or those of a form that is shown again."""
    chosen = request().form.getlist("published") if request()["method"] == "POST" else [folder.name for folder in folders]
    return {"folders": folders, "chosen": chosen}


def check_typed_name(name: str) -> None:
    """Raises BadRequest unless the form repeats the name of what it deletes."""
    if request().form.get("typed", "").strip() != name:
        raise BadRequest(translate("The name that you typed is not {name}. Nothing was removed.", name=name))
