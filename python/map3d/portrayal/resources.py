"""GetResourceById: manifests and tiles of renderings as stored, and PNG tiles of normal, id and depth from data tiles.

Resource ids are `tiles/<rendering>/rendering.json` and `tiles/<rendering>/<view>/<layer>/<z>/<x>/<y>`, the paths of the same files on this server.
"""

from typing import Final

from map3d.catalogue import Catalogue, RenderingRecord, Workspace
from map3d.errors import BadRequest, NotFound
from map3d.geometry.views import track_id
from map3d.portrayal.answers import REVALIDATE, Answer
from map3d.portrayal.parameters import Parameters
from map3d.portrayal.service_exception import ServiceException, invalid, quote
from map3d.tiles.decode_tile import as_layer, find_layer
from map3d.tiles.manifest import FILE_NAME
from map3d.tiles.naming import parse_tile
from map3d.tiles.track_stores import open_track, read_manifest
from map3d.types import TileId, check_name

PREFIX: Final = "tiles"
JSON: Final = "application/json"


class Resources:
    """Threads may share it."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue) -> None:
        self._workspace, self._catalogue = workspace, catalogue

    def renderings(self) -> dict[str, list[str]]:
        """Returns the names of the renderings that have a manifest, by scene."""
        found: dict[str, list[str]] = {}
        for record in self._catalogue.renderings():
            if self._workspace.manifest_path(record.name).exists():
                found.setdefault(record.scene, []).append(record.name)
        return found

    def get(self, parameters: Parameters) -> Answer:
        """Raises ServiceException."""
        identifier, media_type = parameters.require("resourceId"), parameters.require("outputFormat").lower()
        parts = identifier.split("/")
        if len(parts) not in (3, 7) or parts[0] != PREFIX:
            raise _not_found(identifier)
        try:
            record = self._catalogue.rendering(check_name(parts[1], "rendering"))
        except BadRequest as error:
            raise _not_found(identifier) from error
        found = self._manifest(record, parts[2]) if len(parts) == 3 else self._tile(record, *parts[2:])
        if found is None:
            raise _not_found(identifier)
        if found[0] != media_type:
            raise invalid("outputFormat", f"{quote(media_type)}, the resource is {found[0]}")
        return Answer(200, found[0], found[1], REVALIDATE)

    def _manifest(self, record: RenderingRecord, name: str) -> tuple[str, bytes] | None:
        data = read_manifest(self._workspace, record) if name == FILE_NAME else None
        return None if data is None else (JSON, data)

    def _tile(self, record: RenderingRecord, view: str, layer: str, z: str, x: str, y: str) -> tuple[str, bytes] | None:
        """Returns the media type and the bytes; None for a tile without content."""
        tile, frame = parse_tile(z, x, y), record.frame(view)
        found = find_layer(record.layers, layer)
        if tile is None or frame is None or found is None:
            return None
        asked, stored = found
        number = next(number for number, layers in enumerate(record.passes) if stored in layers)
        data = self._read(record, track_id(view, number), stored.name, tile)
        where = f"rendering {record.name}, tile {view}/{stored.name}/{z}/{x}/{y}"
        return None if data is None else (asked.media_type, as_layer(asked, stored, data, frame.tile_px, where))

    def _read(self, record: RenderingRecord, track: str, layer: str, tile: TileId) -> bytes | None:
        try:
            with open_track(self._workspace, record, track) as store:
                return None if tile.z > store.shape.zmax else store.get_tile(store.shape.layer_number(layer), *tile)
        except NotFound:
            return None


def _not_found(identifier: str) -> ServiceException:
    text = f"resourceId: no resource {quote(identifier)}; expected tiles/<rendering>/{FILE_NAME} or tiles/<rendering>/<view>/<layer>/<z>/<x>/<y>"
    return ServiceException("InvalidParameterValue", text, "resourceId", status=404)
