"""A view of a rendering as tile services describe it: its colour layers, its tile matrix set and the extent of its content.

Each view is offered twice. `<rendering>:<view>` has true coordinates: those of the view's plane (map3d.geometry.view_plane_crs).
`<rendering>:<view>:pseudo-mercator` is for clients that know no other grid than WebMercatorQuad: the same tiles, stretched over the map of the
world, at positions without meaning.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError

from map3d.errors import NotFound
from map3d.geometry.crs import horizontal_crs
from map3d.tiles.manifest import Manifest, ManifestView
from map3d.tiles.occupancy import xy_from_morton
from map3d.tiles.view_plane import plane_crs, scene_crs
from map3d.types import COLOR_KINDS, Layer

PIXEL_OF_SCALE_M: Final = 0.00028
"""Side of the pixel that OGC's scale denominators assume."""
WEB_MERCATOR: Final = "WebMercatorQuad"
WEB_MERCATOR_URI: Final = "http://www.opengis.net/def/tilematrixset/OGC/1.0/WebMercatorQuad"
WEB_MERCATOR_CRS: Final = "http://www.opengis.net/def/crs/EPSG/0/3857"
WEB_MERCATOR_HALF_M: Final = 20037508.342789244
WEB_MERCATOR_TILE_PX: Final = 256
PSEUDO_SUFFIX: Final = ":pseudo-mercator"
PSEUDO: Final = "not georeferenced"
"""Part of every title of tiles in Web Mercator."""
PSEUDO_NOTE: Final = (
    "Pseudo Web Mercator for clients that know no other grid: the plane of the view is stretched over the map of the world. Longitudes and latitudes "
    "have no meaning."
)


class NotOffered(NotFound):
    """No such rendering, view, layer, tile matrix set or tile. The message has no paths of the server."""


@dataclass(frozen=True)
class TileMatrix:
    """One level. `origin`: top left corner in the CRS of the set; `count`: tiles in each direction; the least and greatest columns and rows have
    content."""

    level: int
    cell_size: float
    scale_denominator: float
    origin: tuple[float, float]
    tile_px: int
    count: int
    min_column: int
    max_column: int
    min_row: int
    max_row: int

    def holds(self, column: int, row: int) -> bool:
        """Whether the tile is within the limits."""
        return self.min_column <= column <= self.max_column and self.min_row <= row <= self.max_row


@dataclass(frozen=True)
class TiledView:
    """`layers`: picture, then color; the first is the default. `pseudo`: whether it is in pseudo Web Mercator."""

    manifest: Manifest
    view: ManifestView
    layers: tuple[Layer, ...]
    pseudo: bool = False

    @property
    def id(self) -> str:
        return f"{self.manifest.name}:{self.view.frame.id}{PSEUDO_SUFFIX if self.pseudo else ''}"

    @property
    def title(self) -> str:
        return f"{self.manifest.title or self.manifest.name}: view {self.view.frame.id}{f' ({PSEUDO})' if self.pseudo else ''}"

    @property
    def description(self) -> str:
        angles = self.view.frame.angles
        note = f"{PSEUDO_NOTE} " if self.pseudo else ""
        return (
            f"{note}Oblique tiles, seen at look-at angle {angles.look_at_deg:g}° (counter-clockwise from north) and pitch {angles.pitch_deg:g}°. "
            f"{self.manifest.attribution}"
        ).strip()

    def layer(self, name: str | None) -> Layer:
        """Returns a layer; for None, the default one. Raises NotOffered."""
        found = self.layers[0] if name is None else next((layer for layer in self.layers if layer.name == name), None)
        if found is None:
            raise NotOffered(f"{self.id} has no colour layer {name!r:.70}; its colour layers are {', '.join(layer.name for layer in self.layers)}")
        return found

    def crs(self, height_m: float | None = None) -> CRS:
        """Returns the CRS of the view's plane for ground points at a height (map3d.tiles.view_plane). Raises BadRequest."""
        return plane_crs(self.manifest, self.view, height_m)

    @property
    def tile_matrix_set(self) -> str:
        """The id of the tile matrix set."""
        return WEB_MERCATOR if self.pseudo else self.id

    def check_tile_matrix_set(self, name: str) -> None:
        """Raises NotOffered for the name of another one."""
        if name != self.tile_matrix_set:
            raise NotOffered(f"{self.id} has no tile matrix set {name!r:.150}; it has {self.tile_matrix_set}")

    @cached_property
    def matrices(self) -> tuple[TileMatrix, ...]:
        """The levels of the tile matrix set."""
        if self.pseudo:
            return self._matrices(2 * WEB_MERCATOR_HALF_M, (-WEB_MERCATOR_HALF_M, WEB_MERCATOR_HALF_M))
        frame = self.view.frame
        return self._matrices(frame.size_m, (frame.u0_m, frame.v0_m))

    def _matrices(self, size: float, origin: tuple[float, float]) -> tuple[TileMatrix, ...]:
        tile_px = self.manifest.tile_px
        cells = [size / (tile_px * 2**z) for z in range(self.manifest.zmax + 1)]
        return tuple(
            TileMatrix(z, cell, cell / PIXEL_OF_SCALE_M, origin, tile_px, 2**z, *limits)
            for z, (cell, limits) in enumerate(zip(cells, self._limits, strict=True))
        )

    @cached_property
    def _limits(self) -> tuple[tuple[int, int, int, int], ...]:
        return tuple(self._level_limits(z) for z in range(self.manifest.zmax + 1))

    def _level_limits(self, z: int) -> tuple[int, int, int, int]:
        """Returns the least and greatest column, then row, with content; the first tile for an empty pyramid."""
        columns, rows = xy_from_morton(self.view.occupancy.numbers(z))
        return (int(columns.min()), int(columns.max()), int(rows.min()), int(rows.max())) if len(columns) else (0, 0, 0, 0)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top of the tiles with content, in the CRS of the tile matrix set."""
        deepest = self.matrices[-1]
        (left, top), side = deepest.origin, deepest.cell_size * deepest.tile_px
        return (
            left + deepest.min_column * side,
            top - (deepest.max_row + 1) * side,
            left + (deepest.max_column + 1) * side,
            top - deepest.min_row * side,
        )

    def pseudo_lon_lat_extent(self) -> tuple[float, float, float, float]:
        """Returns west, south, east, north of the tiles with content in pseudo Web Mercator, degrees."""
        side = 1 << self.manifest.zmax
        min_column, max_column, min_row, max_row = self._limits[-1]
        west, east = (column / side * 360 - 180 for column in (min_column, max_column + 1))
        south, north = (float(np.degrees(np.arctan(np.sinh(np.pi * (1 - 2 * row / side))))) for row in (max_row + 1, min_row))
        return (west, south, east, north)

    @cached_property
    def lon_lat_extent(self) -> tuple[float, float, float, float] | None:
        """The west, south, east and north of the scene's content in WGS 84, degrees; None for a scene with local coordinates. In pseudo Web Mercator,
        that of the stretched tiles."""
        if self.pseudo:
            return self.pseudo_lon_lat_extent()
        crs = scene_crs(self.manifest.crs)
        if crs is None:
            return None
        (x0, y0, _), (x1, y1, _) = self.manifest.box
        x, y, _ = self.manifest.origin
        try:
            bounds = Transformer.from_crs(horizontal_crs(crs), "EPSG:4326", always_xy=True).transform_bounds(x + x0, y + y0, x + x1, y + y1)
        except ProjError:
            return None
        return bounds if np.isfinite(bounds).all() else None


def tiled_views(manifest: Manifest) -> tuple[TiledView, ...]:
    """Returns the views of a rendering; none if it has no colour layer. Tiles of 512 px do not fit WebMercatorQuad, which has 256."""
    layers = tuple(sorted((layer for layer in manifest.layers if layer.kind in COLOR_KINDS), key=lambda layer: layer.kind != "picture"))
    kinds = (False, True) if manifest.tile_px == WEB_MERCATOR_TILE_PX else (False,)
    return tuple(TiledView(manifest, view, layers, pseudo) for view in manifest.views for pseudo in kinds) if layers else ()


def find_tiled_view(views: Iterable[TiledView], view_id: str) -> TiledView:
    """Returns the view with an id. Raises NotOffered."""
    for view in views:
        if view.id == view_id:
            return view
    raise NotOffered(f"no collection {view_id!r:.150}; a collection is <rendering>:<view>, or <rendering>:<view>:pseudo-mercator")
