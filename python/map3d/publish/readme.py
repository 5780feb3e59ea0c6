"""The note in a published folder."""

from typing import Final

from map3d.tiles.manifest import Manifest

README: Final = "README.txt"

_TEXT: Final = """{title}
{attribution}
This folder is a rendering made with map3d: a map of oblique views. It is whole in itself. Copy it to any web host and open index.html there.

The host must
- serve range requests (HTTP "Range"): nginx, Apache, Caddy, S3 and its like do. `python -m http.server` does not: the map stays empty with it.
  To look at it on your own machine: `caddy file-server --listen :8000`, or nginx with `root` at this folder.
- not compress *.pmtiles on the way (they hold compressed images already).
To use its tiles from pages of other hosts, let it send `Access-Control-Allow-Origin: *` and allow the request header `Range`.

rendering.json     what there is: views, layers, levels, coordinate system
<view>/<layer>.pmtiles   the tiles of a view and layer
objects/           attributes of the objects, and the index for searching
index.html, *.js   the viewer
checksums.sha256   to check a copy: sha256sum -c checksums.sha256
"""


def readme(manifest: Manifest) -> str:
    attribution = f"{manifest.attribution}\n" if manifest.attribution else ""
    return _TEXT.format(title=manifest.title or manifest.name, attribution=attribution)
