"""Creates renderings: pins the frames of the views to the current extent of the scene."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Final

from map3d.catalogue import Catalogue, RenderingRecord, Workspace
from map3d.catalogue.records import WINDOW
from map3d.errors import BadRequest
from map3d.geometry.frames import Window, pin, pin_into
from map3d.geometry.views import check_angles
from map3d.lifecycle.remove_rendering import finish_rendering_removal
from map3d.renderings.block_limit import check_block_count
from map3d.renderings.layers import check_layers, make_layers
from map3d.requests import AddLayers, CreateRendering
from map3d.scenes.build import is_stale, open_scene
from map3d.tiles.track_stores import TILES, check_tiles_url, remove_tracks
from map3d.types import Box, ViewAngles, check_name

COARSEST_M: Final = 1e6


def check_rendering(catalogue: Catalogue, request: CreateRendering) -> None:
    """Checks everything that does not depend on the built scene; raises BadRequest, NotFound."""
    check_name(request.name, "rendering")
    scene = catalogue.scene(request.scene)
    for view in request.angles():
        check_angles(view)
    if request.window is not None:
        Window(*request.window)
    if (request.res_m is None) == (request.levels is None):
        raise BadRequest("missing resolution: give either --res METRES_PER_PIXEL or --levels N")
    if request.regrid:
        catalogue.rendering(request.name)
        if request.tiles is not None:
            raise BadRequest(f"rendering {request.name}: --tiles cannot change with --regrid; create another rendering instead")
    else:
        _check_free(catalogue, request.name)
    check_layers(request.layer_names(), request, scene)
    if request.tiles is not None:
        check_tiles_url(request.tiles)


def create_rendering(workspace: Workspace, catalogue: Catalogue, request: CreateRendering) -> RenderingRecord:
    """Pins the frames to the box of the scene, whose build must be up to date. Raises BadRequest, NotFound."""
    record = draft_rendering(workspace, catalogue, request)
    if request.regrid:
        stored = catalogue.regrid(record)
        remove_tracks(workspace, stored)
        return stored
    finish_rendering_removal(workspace, record.name)
    catalogue.create_rendering(record)
    return record


def draft_rendering(workspace: Workspace, catalogue: Catalogue, request: CreateRendering) -> RenderingRecord:
    """Returns the rendering that `create_rendering` would store. Raises BadRequest, NotFound."""
    check_rendering(catalogue, request)
    if is_stale(workspace, catalogue, request.scene):
        raise BadRequest(f"scene {request.scene} has changed since its last build; build it first")
    scene = open_scene(workspace, request.scene)
    box = scene.box
    window = _local_window(catalogue, request)
    res_m = choose_res(box, request)
    frames = tuple(pin(box, request.tile_px, res_m, request.angles(), window))
    check_block_count(scene, frames, request.name)
    tiles = catalogue.rendering(request.name).options.get(TILES) if request.regrid else request.tiles
    options = ({} if window is None else {WINDOW: asdict(window)}) | ({} if tiles is None else {TILES: check_tiles_url(tiles)})
    return RenderingRecord(
        request.name,
        request.scene,
        res_m,
        (make_layers(request.layer_names(), request, catalogue.scene(request.scene), box),),
        frames,
        box,
        request.title,
        request.attribution,
        options,
    )


def add_views(catalogue: Catalogue, name: str, views: Sequence[ViewAngles]) -> RenderingRecord:
    """Adds views with the frames that they would have had from the start; existing views do not change.

    Raises NotFound, BadRequest for a view that exists already, OutsideFrame for one that does not fit the rendering's square.
    """
    record = catalogue.rendering(name)
    frames = [pin_into(record.frames[0], record.box, view, record.window) for view in views]
    ids = [frame.id for frame in (*record.frames, *frames)]
    if duplicates := sorted({view for view in ids if ids.count(view) > 1}):
        raise BadRequest(f"rendering {name}: view {', '.join(duplicates)} exists already or is given twice")
    return catalogue.add_frames(name, frames)


def add_layers(catalogue: Catalogue, name: str, request: AddLayers) -> RenderingRecord:
    """Adds layers to a rendering as a new pass; existing layers do not change.

    Raises NotFound, BadRequest for a name that exists already, and the errors of `make_layers`.
    """
    record = catalogue.rendering(name)
    scene = catalogue.scene(record.scene)
    if duplicates := sorted({layer.name for layer in record.layers} & set(check_layers(request.layers, request, scene))):
        raise BadRequest(f"rendering {name}: layer {', '.join(duplicates)} exists already; give the new one another name, as NAME=KIND")
    return catalogue.add_pass(name, make_layers(request.layers, request, scene, record.box))


def choose_res(box: Box, request: CreateRendering) -> float:
    """Returns the requested resolution, or the finest that fits `levels`: rounded up to three digits, exact for a window."""
    if request.res_m is not None:
        return request.res_m
    assert request.levels is not None, "checked: res_m or levels is set"
    if request.window is not None:
        return request.window[2] / (request.tile_px * 2.0 ** (request.levels - 1))
    extent_m = _extent_m(box, request)
    exact = extent_m / (request.tile_px * 2.0 ** (request.levels - 1))
    return _rounded_up(exact)


def _local_window(catalogue: Catalogue, request: CreateRendering) -> Window | None:
    if request.window is None:
        return None
    x_m, y_m, size_m = request.window
    origin = catalogue.scene(request.scene).origin
    assert origin is not None, "a built scene has an origin"
    return Window(x_m - origin[0], y_m - origin[1], size_m)


def _extent_m(box: Box, request: CreateRendering) -> float:
    """Returns the side of the smallest square that `pin` accepts for all views, by bisection."""
    low, high = 0.0, COARSEST_M
    while high - low > 1e-9 * high:
        middle = (low + high) / 2
        if pin(box, request.tile_px, middle, request.angles())[0].zmax == 0:
            high = middle
        else:
            low = middle
    return high * request.tile_px


def _rounded_up(value: float) -> float:
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return round(math.ceil(value / unit) * unit, 12)


def _check_free(catalogue: Catalogue, name: str) -> None:
    if any(record.name == name for record in catalogue.renderings()):
        raise BadRequest(f"rendering {name}: exists already; choose another name, or use --regrid to replace its frames and render everything again")
