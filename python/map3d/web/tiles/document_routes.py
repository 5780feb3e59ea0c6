"""Routes of the JSON documents of a rendering: manifest, attribute shards and columns, search index (spec/manifest.md).

Each is available under /tiles/<rendering>/ and under /view/<rendering>/, where the viewer's page finds it in its own folder, as in a published one.
"""

import re
from pathlib import Path
from typing import Final

from starlette.responses import Response

from map3d.errors import NotFound
from map3d.registry import Registry
from map3d.registry.documents import dump_document
from map3d.scenes.scene_cache import scene_in_use
from map3d.tiles.manifest import FILE_NAME
from map3d.tiles.track_stores import read_manifest
from map3d.types import check_name
from map3d.web.http.current import catalogue, workspace
from map3d.web.http.responses import document as respond
from map3d.web.http.routes import Routes
from map3d.web.tiles.object_documents import Build, ObjectDocuments

documents = Routes("documents")
_JSON: Final = "application/json"

_SHARD: Final = re.compile(r"0|[1-9][0-9]{0,6}", re.ASCII)
"""Shard numbers have at most seven digits, because ids have 32 bits."""

_BUILDS: Final[dict[re.Pattern[str], Build]] = {
    re.compile(r"search(/[0-9a-f]{16})?", re.ASCII): Registry.search_documents,
    re.compile(r"attributes", re.ASCII): Registry.attribute_documents,
    re.compile(r"columns/[0-9a-f]{16}(/[0-9]{1,7})?", re.ASCII): Registry.column_documents,
}
_object_documents: Final = ObjectDocuments()


@documents.get(f"/tiles/{{rendering}}/{FILE_NAME}")
@documents.get(f"/view/{{rendering}}/{FILE_NAME}")
def manifest(rendering: str) -> Response:
    data = read_manifest(workspace(), catalogue().rendering(check_name(rendering, "rendering")))
    if data is None:
        raise NotFound(f"rendering {rendering!r} has no tiles yet; run: map3d render {rendering}")
    return respond(data, _JSON)


def shard(rendering: str, shard: str) -> Response:
    """Returns an attribute shard, possibly without objects."""
    if not _SHARD.fullmatch(shard):
        raise NotFound(f"no shard {shard[:64]!r}; shard names are plain numbers")
    with Registry(registry_path(rendering)) as objects:
        return respond(dump_document(objects.shard(int(shard))), _JSON)


@documents.get("/tiles/{rendering}/objects/{document:path}.json")
@documents.get("/view/{rendering}/objects/{document:path}.json")
def object_document(rendering: str, document: str) -> Response:
    """Returns a document of the search index or of the attribute columns, or an attribute shard."""
    if document not in ("search", "attributes") and "/" not in document:
        return shard(rendering, document)
    build = next((build for pattern, build in _BUILDS.items() if pattern.fullmatch(document)), None)
    data = None if build is None else _object_documents.get(registry_path(rendering), build, f"objects/{document}.json")
    if data is None:
        raise NotFound(f"no document {document[:64]!r}; search.json and attributes.json in objects/ lead to all others")
    return respond(data, _JSON)


def registry_path(rendering: str) -> Path:
    """Returns the registry of the rendering's scene, which is fetched first if another host builds the scene. Raises NotFound."""
    scene = catalogue().scene(catalogue().rendering(check_name(rendering, "rendering")).scene)
    path = workspace().registry_path(scene.name)
    if not path.is_file():
        with scene_in_use(workspace(), scene):
            pass
    if not path.is_file():
        raise NotFound(f"the scene of rendering {rendering!r} has no objects yet; run: map3d add-files")
    return path
