"""Routes of pictures to share: any part of a stored view as an image, QR codes of links, and the view that a link names."""

import io
import threading
from hashlib import sha256
from typing import Final
from urllib.parse import quote

import segno
from starlette.responses import Response

from map3d.errors import BadRequest, NotFound, Unavailable
from map3d.tile_services.picture import draw_picture
from map3d.tile_services.picture_request import PictureRequest, parse_link, parse_picture
from map3d.tiles.manifest import Manifest
from map3d.tiles.track_stores import read_manifest
from map3d.types import Layer, TileId, check_name
from map3d.web.http.byte_lru import ByteLru
from map3d.web.http.current import catalogue, request, site, workspace
from map3d.web.http.public_url import public_url
from map3d.web.http.responses import is_known, revalidated
from map3d.web.http.routes import Routes

pictures = Routes("pictures")

AT_ONCE: Final = 2
"""Pictures that a process draws at the same time."""
QUEUE: Final = 4
"""Requests that are drawn or wait; further ones are refused, so that pictures never take all threads."""
RETRY_S: Final = 5
CACHE_BYTES: Final = 32 << 20
QR_SCALE: Final = 8
_cache: Final[ByteLru[str, bytes]] = ByteLru(CACHE_BYTES)
_cache_lock: Final = threading.Lock()
_drawing: Final = threading.Semaphore(AT_ONCE)
_queue: Final = threading.Semaphore(QUEUE)


@pictures.get("/{rendering}/static/{where}/{size}")
@pictures.get("/pictures/{rendering}/{where}/{size}")
def picture(rendering: str, where: str, size: str) -> Response:
    """Returns a picture. The second address also works for a rendering whose name begins other addresses of the server, such as `view`."""
    data, manifest = _manifest(rendering)
    asked = parse_picture(manifest, where, size, request().query_params.get("style"), request().query_params.get("t"))
    key = sha256(f"{rendering}/{asked.address}\n".encode() + data).hexdigest()[:32]
    etag = f'"{key}"'
    drawn = b"" if is_known(etag) else _draw(key, rendering, manifest, asked)
    return revalidated(drawn, asked.media_type, etag, {"Content-Location": public_url(f"pictures/{rendering}/{asked.address}")})


@pictures.get("/view/{rendering}/qr.svg")
def qr_code(rendering: str) -> Response:
    """Returns a QR code of the link to a view as SVG."""
    _, manifest = _manifest(rendering)
    link = request().query_params.get("view", "")
    parse_link(manifest, link, (1, 1), "image/png")
    out = io.BytesIO()
    segno.make(link_url(rendering, link), error="m", micro=False).save(
        out, kind="svg", scale=QR_SCALE, border=4, dark="#000", light="#fff", title=rendering
    )
    return Response(out.getvalue(), 200, {"Cache-Control": "no-cache"}, "image/svg+xml; charset=utf-8")


def link_url(rendering: str, link: str) -> str:
    """Returns the address of a view: `link` is `<view>/<x>/<y>/<z>/<zoom>`, possibly with more parts."""
    return public_url(f"view/{rendering}/") + f"?view={quote(link, safe='/=:,')}"


def _manifest(rendering: str) -> tuple[bytes, Manifest]:
    data = read_manifest(workspace(), catalogue().rendering(check_name(rendering, "rendering")))
    if data is None:
        raise NotFound(f"rendering {rendering!r} has no tiles yet; run: map3d render {rendering}")
    return data, Manifest.load(data, rendering)


def _draw(key: str, rendering: str, manifest: Manifest, asked: PictureRequest) -> bytes:
    with _cache_lock:
        known = _cache.get(key)
    if known is not None:
        return known
    if not _queue.acquire(blocking=False):
        raise Unavailable("too many pictures are being drawn; try again", retry_s=RETRY_S)
    try:
        with _drawing:
            drawn = draw_picture(manifest, asked, _TileReader(rendering, asked))
    finally:
        _queue.release()
    with _cache_lock:
        _cache.put(key, drawn, len(drawn))
    return drawn


class _TileReader:
    """Reads the tiles of a view from the stores of its tracks."""

    def __init__(self, rendering: str, asked: PictureRequest) -> None:
        self._layers = {
            name: (opened.store, number)
            for opened in site().stores.stores_of_view(rendering, asked.view.frame.id)
            for name, (number, _) in opened.layers.items()
        }

    def __call__(self, layer: Layer, tile: TileId) -> bytes | None:
        if layer.name not in self._layers:
            raise BadRequest(f"no layer {layer.name!r}")
        store, number = self._layers[layer.name]
        return store.get_tile(number, *tile)
