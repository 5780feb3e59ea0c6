"""The pages: the list of renderings, the viewer of one, and whether the service is alive."""

from dataclasses import dataclass

from flask import Blueprint, Response, render_template, send_from_directory

from map3d.catalogue import RenderingRecord
from map3d.errors import Map3dError
from map3d.tiles.manifest import Manifest
from map3d.tiles.viewer_files import PAGE, viewer_folder
from map3d.types import check_name
from map3d.web.compression import pack
from map3d.web.document_routes import catalogue, workspace
from map3d.web.http_errors import status_of

pages = Blueprint("pages", __name__)


@dataclass(frozen=True)
class Card:
    """A rendering in the list. `preview`: URL of its smallest colour tile, None when there is none yet."""

    name: str
    title: str
    attribution: str
    state: str
    preview: str | None


@pages.get("/")
def renderings() -> str:
    return render_template("renderings.html", cards=[_card(record) for record in catalogue().renderings()])


@pages.get("/view/<rendering>/")
def view(rendering: str) -> Response:
    catalogue().rendering(check_name(rendering, "rendering"))
    return pack(send_from_directory(viewer_folder(), PAGE, max_age=0))


@pages.get("/view/<rendering>/<path:file>")
def viewer_file(rendering: str, file: str) -> Response:
    catalogue().rendering(check_name(rendering, "rendering"))
    return pack(send_from_directory(viewer_folder(), file, max_age=0))


@pages.get("/healthz")
def healthz() -> Response:
    """200 while the catalogue can be read."""
    catalogue().renderings()
    response = Response("ok\n", mimetype="text/plain")
    response.headers["Cache-Control"] = "no-store"
    return response


def _card(record: RenderingRecord) -> Card:
    title, attribution = record.title or record.name, record.attribution
    try:
        manifest = Manifest.load(workspace().manifest_path(record.name).read_bytes())
    except FileNotFoundError:
        return Card(record.name, title, attribution, "nothing rendered yet", None)
    except (Map3dError, OSError) as error:
        status_of(error if isinstance(error, Map3dError) else Map3dError(f"rendering {record.name}: {error}"))
        return Card(record.name, title, attribution, "its manifest cannot be read; the log says why", None)
    views = len(manifest.views)
    tiles = sum(one.occupancy.count(manifest.zmax) for one in manifest.views)
    state = f"{views} view{'s' if views != 1 else ''}, {tiles:,} tiles of the deepest level" + ("" if manifest.complete else ", not complete yet")
    return Card(record.name, title, attribution, state, _preview(manifest))


def _preview(manifest: Manifest) -> str | None:
    color = next((layer.name for layer in manifest.layers if layer.kind == "color"), None)
    view = next((one for one in manifest.views if one.occupancy.count(0)), None)
    return None if color is None or view is None else f"/tiles/{manifest.name}/{view.frame.id}/{color}/0/0/0"
