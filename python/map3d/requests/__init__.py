"""One request for each verb: what the command line, the REST API, the library and the forms of the web interface ask for. Their options, schemas,
keywords and fields are views of it, and tests/requests compares them."""

from map3d.requests.publications import Export, Publish
from map3d.requests.reading import AddFiles, Inspect
from map3d.requests.removals import RemoveFiles, RemovePublished, RemoveRendering, RemoveScene
from map3d.requests.renderings import AddLayers, AddViews, ChangeRendering, CreateRendering, Estimate, LayerDetails, Render
from map3d.requests.scenes import Build, CreateScene
from map3d.requests.site import Site

__all__ = [
    "AddFiles",
    "AddLayers",
    "AddViews",
    "Build",
    "ChangeRendering",
    "CreateRendering",
    "CreateScene",
    "Estimate",
    "Export",
    "Inspect",
    "LayerDetails",
    "Publish",
    "RemoveFiles",
    "RemovePublished",
    "RemoveRendering",
    "RemoveScene",
    "Render",
    "Site",
]
