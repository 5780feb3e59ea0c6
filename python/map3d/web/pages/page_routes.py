"""Pages: the list of renderings, the viewer of one rendering, and icons."""

import time
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Final

from starlette.responses import Response

from map3d.catalogue import RenderingRecord, Workspace
from map3d.errors import Map3dError, NotFound
from map3d.publish.page_head import MAX_TITLE, cut, describe_page
from map3d.publish.preview_picture import FILE as PREVIEW
from map3d.publish.preview_picture import HEIGHT_PX, WIDTH_PX, make_preview
from map3d.tile_services.picture_request import parse_link
from map3d.tiles.manifest import Manifest
from map3d.tiles.preview import choose_preview
from map3d.tiles.track_stores import read_manifest, tiles_url
from map3d.tiles.viewer_files import PAGE, viewer_folder
from map3d.types import check_name
from map3d.web.http.current import catalogue, request, site, workspace
from map3d.web.http.http_errors import status_of
from map3d.web.http.public_url import public_url
from map3d.web.http.responses import compress, document, file_response, redirect, uncached
from map3d.web.http.routes import Routes
from map3d.web.pages.share_dialog import add_share_dialog
from map3d.web.pages.tools import render
from map3d.web.tiles.picture_routes import link_url

pages = Routes("pages")

STATIC: Final = Path(__file__).parents[1] / "static"

ICON_MAX_AGE_S = 86_400
ON_DEMAND_PREVIEW_S = 60.0
"""Age at which a preview is drawn again while tiles are rendered on demand, which does not change the manifest."""


@dataclass(frozen=True)
class ListedRendering:
    """A rendering in the list. `state`: complete, incomplete, empty (nothing rendered yet) or unreadable.

    `changed`: time of the last manifest that this host wrote.
    `bytes` is unknown for tiles outside the workspace.
    """

    name: str
    title: str
    attribution: str
    state: str
    bytes: int | None = None
    views: int = 0
    layers: int = 0
    changed: datetime | None = None
    has_picture: bool = False


@pages.get("/")
def home() -> Response:
    """Redirects to the map if the workspace has exactly one rendering with tiles; otherwise lists the renderings."""
    records = catalogue().renderings()
    if len(records) == 1 and read_manifest(workspace(), records[0]) is not None:
        return redirect(f"view/{records[0].name}/", 302)
    return renderings()


@pages.get("/renderings")
def renderings() -> Response:
    """Lists the renderings with pictures that are made of stored tiles."""
    listed = sorted((_describe(record) for record in catalogue().renderings()), key=lambda item: (item.changed is None, item.title.casefold()))
    return compress(uncached(render("renderings.html", renderings=listed)))


@pages.get("/view/{rendering}/")
def view(rendering: str) -> Response:
    """Returns the viewer's page; once the rendering has tiles, with its title and picture."""
    record = catalogue().rendering(check_name(rendering, "rendering"))
    data = read_manifest(workspace(), record)
    if data is None:
        return file_response(viewer_folder(), PAGE)
    manifest = Manifest.load(data, rendering)
    address, picture = _shared_view(rendering, manifest)
    page = add_share_dialog(describe_page((viewer_folder() / PAGE).read_text("utf-8"), manifest, picture, address))
    return document(page.encode(), "text/html")


@pages.get(f"/view/{{rendering}}/{PREVIEW}")
def preview(rendering: str) -> Response:
    """Returns a picture of the rendering for links to its page."""
    record = catalogue().rendering(check_name(rendering, "rendering"))
    data = read_manifest(workspace(), record)
    age = int(time.monotonic() / ON_DEMAND_PREVIEW_S) if renders_on_demand() else 0
    picture = None if data is None else _preview(workspace(), rendering, data, age)
    if picture is None:
        raise NotFound(f"rendering {rendering!r} has no picture yet; run: map3d render {rendering}")
    return document(picture, "image/jpeg")


@pages.get("/view/{rendering}/{file:path}", is_file=True)
def viewer_file(rendering: str, file: str) -> Response:
    """Returns a file of the viewer, which is the same for all renderings."""
    return file_response(viewer_folder(), file)


@pages.get("/favicon.ico", is_file=True)
@pages.get("/favicon.svg", is_file=True)
def icon() -> Response:
    return file_response(STATIC, request()["path"][1:], ICON_MAX_AGE_S)


@pages.get("/static/{file:path}", is_file=True)
def static(file: str) -> Response:
    return file_response(STATIC, file)


def renders_on_demand() -> bool:
    return site().settings.on_demand is not None


def _shared_view(rendering: str, manifest: Manifest) -> tuple[str, str | None]:
    """Returns the address of the page and of its picture: those of the view that the query names, else those of the whole rendering."""
    link = request().query_params.get("view")
    if link is not None:
        try:
            picture = parse_link(manifest, link, (WIDTH_PX, HEIGHT_PX), "image/jpeg")
            return link_url(rendering, link), public_url(f"pictures/{rendering}/{picture.address}")
        except Map3dError:
            pass  # the page itself shows what it can of a broken link
    address = public_url(f"view/{rendering}/")
    return address, address + PREVIEW if choose_preview(manifest) else None


@lru_cache(maxsize=64)
def _preview(home: Workspace, rendering: str, manifest: bytes, _age: int) -> bytes | None:
    return make_preview(home, catalogue().rendering(rendering), Manifest.load(manifest, rendering))


def _describe(record: RenderingRecord) -> ListedRendering:
    name, title, attribution = record.name, cut(record.title or record.name, MAX_TITLE), cut(record.attribution, MAX_TITLE)
    path = workspace().manifest_path(name)
    try:
        data = read_manifest(workspace(), record)
        if data is None:
            return ListedRendering(name, title, attribution, "empty")
        manifest = Manifest.load(data, str(path))
        changed = datetime.fromtimestamp(path.stat().st_mtime, UTC) if path.is_file() else None
        size = sum(file.stat().st_size for file in path.parent.iterdir() if file.is_file()) if tiles_url(record) is None else None
    except (Map3dError, OSError) as error:
        status_of(error if isinstance(error, Map3dError) else Map3dError(f"rendering {name}: {error}"))
        return ListedRendering(name, title, attribution, "unreadable")
    state = "complete" if manifest.complete else "incomplete"
    return ListedRendering(
        name, title, attribution, state, size, len(manifest.views), len(manifest.layers), changed, choose_preview(manifest) is not None
    )
