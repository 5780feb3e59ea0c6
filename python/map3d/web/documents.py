"""The JSON documents beside the tiles: manifest, attribute shards, search index (spec/manifest.md). Any origin may read them.

They stand under /tiles/<rendering>/ and under /view/<rendering>/, whose page reads them as its own folder's, as in a published folder.
"""

import re
from hashlib import sha256
from typing import Final

from flask import Blueprint, Response, current_app, request

from map3d.catalogue import Catalogue, Workspace
from map3d.errors import NotFound
from map3d.tiles.manifest import FILE_NAME
from map3d.types import check_name

documents = Blueprint("documents", __name__)

_NUMBER: Final = re.compile(r"0|[1-9][0-9]{0,6}", re.ASCII)


@documents.get(f"/tiles/<rendering>/{FILE_NAME}")
@documents.get(f"/view/<rendering>/{FILE_NAME}")
def manifest(rendering: str) -> Response:
    path = workspace().manifest_path(check_name(rendering, "rendering"))
    try:
        return json_answer(path.read_bytes())
    except FileNotFoundError as error:
        raise NotFound(f"rendering {rendering!r} is not there, or nothing of it is rendered yet") from error


def workspace() -> Workspace:
    home: Workspace = current_app.config["WORKSPACE"]
    return home


def catalogue() -> Catalogue:
    """Opened at the first question, then kept."""
    held: Catalogue | None = current_app.extensions.get("map3d.catalogue")
    if held is None:
        held = current_app.extensions.setdefault("map3d.catalogue", workspace().open_catalogue())
    return held


def json_answer(data: bytes) -> Response:
    """With an ETag, to be asked for anew each time."""
    response = Response(data, mimetype="application/json")
    response.set_etag(sha256(data).hexdigest()[:32])
    response.headers["Cache-Control"] = "no-cache"
    response.headers["Access-Control-Allow-Origin"] = "*"
    response.make_conditional(request)
    return response
