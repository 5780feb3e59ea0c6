"""Pages of operations: progress, log, cancel, retry."""

from typing import Final

from starlette.responses import Response

from map3d.errors import BadRequest
from map3d.web.http.current import catalogue, request
from map3d.web.http.guards import requires
from map3d.web.http.routes import Routes
from map3d.web.studio.operation_words import message_text, show, show_all
from map3d.web.studio.shared import ask, go_to, page

operation_pages = Routes("operation_pages", "/studio/operations")

LISTED: Final = 100


@operation_pages.get("/")
@requires("viewer")
def operations() -> Response:
    listed = show_all(catalogue().operations(limit=LISTED))
    return page("operations.html", operations=listed, running=any(one.is_open for one in listed))


@operation_pages.get("/{id}")
@requires("viewer")
def operation(id: str) -> Response:
    shown = show(catalogue().operation(id))
    log = [message_text(line.text) for line in catalogue().operation_log(id)]
    return page("operation.html", operation=shown, log=log, running=shown.is_open)


@operation_pages.post("/{id}/cancel")
@requires("editor")
def cancel(id: str) -> Response:
    return go_to(f"studio/operations/{catalogue().cancel_operation(id).id}")


@operation_pages.post("/{id}/import")
@requires("editor")
def import_again(id: str) -> Response:
    """Asks for an import of the same uploads with another coordinate system, and for a build after it."""
    before = catalogue().operation(id)
    if before.kind != "import":
        raise BadRequest(f"operation {id}: is not an import")
    crs = request().form.get("crs", "").strip()
    arguments = {**before.arguments, "options": {**before.arguments.get("options", {}), **({"crs": crs} if crs else {})}}
    ask("import", before.target, **arguments)
    ask("build", before.target)
    return go_to(f"studio/scenes/{before.target}")


@operation_pages.post("/{id}/retry")
@requires("editor")
def retry(id: str) -> Response:
    return go_to(f"studio/operations/{catalogue().retry_operation(id).id}")
