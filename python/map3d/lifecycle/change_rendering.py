"""Changes what the map of a rendering says and how it opens, without rendering."""

from typing import Any

from map3d.catalogue import Catalogue, RenderingRecord, Workspace
from map3d.catalogue.records import DESCRIPTION, START_VIEW
from map3d.errors import BadRequest
from map3d.geometry.views import view_id
from map3d.renderings.manifest_writer import describe_manifest
from map3d.requests.renderings import MapTexts


def change_rendering(workspace: Workspace, catalogue: Catalogue, name: str, request: MapTexts) -> RenderingRecord:
    """Changes what is not None, in the catalogue and in the manifest, and returns the rendering. Publications follow when they are published again.

    Raises NotFound, and BadRequest for a start view that the rendering does not have.
    """
    record = catalogue.rendering(name)
    changes = map_options(record, request)
    title = record.title if request.title is None else request.title
    attribution = record.attribution if request.attribution is None else request.attribution
    stored = catalogue.describe_rendering(name, title, attribution, {**record.options, **changes})
    describe_manifest(workspace, catalogue, stored)
    return stored


def map_options(record: RenderingRecord, request: MapTexts) -> dict[str, Any]:
    """Returns the options of the rendering that the request changes. Raises BadRequest."""
    found = {} if request.description is None else {DESCRIPTION: request.description}
    if request.start_view is None:
        return found
    view = view_id(request.start_view)
    if record.frame(view) is None:
        raise BadRequest(f"rendering {record.name}: no view {view}; it has {', '.join(frame.id for frame in record.frames)}")
    return {**found, START_VIEW: view}
