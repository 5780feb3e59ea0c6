"""Applies the options of a later run of `map3d site` to the rendering that exists: what is given is changed, the rest stays as it is."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from map3d.catalogue import Catalogue, RenderingRecord, Workspace
from map3d.errors import BadRequest, OutsideFrame
from map3d.geometry.frames import check_content, pin, pin_into
from map3d.geometry.views import view_id
from map3d.lifecycle.change_rendering import change_rendering
from map3d.lifecycle.create_rendering import add_layers, add_views
from map3d.renderings.layers import LOSSY
from map3d.requests import AddLayers, Site
from map3d.requests.renderings import LayerDetails, MapTexts
from map3d.tiles.track_stores import remove_tracks
from map3d.types import DATA_TILE_KINDS, LAYERS, LAYERS_BY_DATA, Box, DataEncoding, Layer, LayerKind, ViewAngles


@dataclass(frozen=True)
class LaterRun:
    """The rendering after its options have changed. `again`: the options for which everything is rendered again; `outgrown`: everything is rendered
    again since content has left the frames; `added`: what is rendered in addition."""

    record: RenderingRecord
    again: tuple[str, ...] = ()
    outgrown: bool = False
    added: tuple[str, ...] = ()


def apply_options(workspace: Workspace, catalogue: Catalogue, request: Site, record: RenderingRecord, box: Box, ao_radius_m: float) -> LaterRun:
    """Changes the rendering as the request says. `box`: the present local box of the scene; `ao_radius_m`: of ambient occlusion, if it is added.
    Raises BadRequest for a start view that the rendering will not have; then nothing is changed."""
    views = request.views or tuple(frame.angles for frame in record.frames)
    check_start_view(request, views)
    again = tuple(_changed_options(request, record))
    new = [view for view in views if record.frame(view_id(view)) is None]
    outgrown = not again and _is_outgrown(record, new, box)
    if again or outgrown:
        passes = tuple(tuple(_changed_layers(request, layers)) for layers in record.passes)
        res_m = request.res_m or record.res_m
        frames = tuple(pin(box, record.tile_px, res_m, views, record.window))
        record = catalogue.regrid(replace(record, res_m=res_m, passes=tuple(filter(None, passes)), frames=frames, box=box))
        remove_tracks(workspace, record)
        new = []
    elif new:
        record = add_views(catalogue, record.name, new)
    added = [f"view {view_id(view)}" for view in new]
    if request.ao and not _has(record, "ao"):
        small = any(layer.small for layer in record.layers)
        record = add_layers(catalogue, record.name, AddLayers(layers=("ao",), radius_m=ao_radius_m, small=small))
        added.append("ambient occlusion")
    texts = MapTexts(title=request.title, attribution=request.attribution, description=request.description, start_view=request.start_view)
    if texts != MapTexts():
        record = change_rendering(workspace, catalogue, record.name, texts)
    return LaterRun(record, again, outgrown, tuple(added))


def check_start_view(request: Site, views: Sequence[ViewAngles]) -> None:
    """Raises BadRequest for a start view that is not one of the views that the map will have."""
    known = [view_id(view) for view in views]
    if request.start_view is not None and view_id(request.start_view) not in known:
        raise BadRequest(f"--start-view {view_id(request.start_view)}: the map has the views {', '.join(known)}; --view adds views")


def _changed_options(request: Site, record: RenderingRecord) -> Iterator[str]:
    """Yields the options that do not fit what is rendered."""
    if request.res_m is not None and request.res_m != record.res_m:
        yield "--res"
    if request.views and not {frame.id for frame in record.frames} <= {view_id(view) for view in request.views}:
        yield "--view"
    if request.color is not None and any(layer.kind == "color" and layer.format != request.color for layer in record.layers):
        yield "--color"
    if request.data is not None and request.data != _data(record):
        yield "--data"
    if request.small is not None and any(layer.small != request.small for layer in record.layers):
        yield "--small" if request.small else "--no-small"
    if request.ao is False and _has(record, "ao"):
        yield "--no-ao"


def _changed_layers(request: Site, layers: Sequence[Layer]) -> Iterator[Layer]:
    """Yields the layers of a pass as the request wants them, in the order of kinds."""
    wanted: list[LayerKind] = [kind for kind in LAYERS_BY_DATA[request.data] if kind != "color"] if request.data is not None else []
    of_data = [layer for layer in layers if layer.kind in ("data", *DATA_TILE_KINDS)]
    if wanted and of_data:
        kinds: set[LayerKind] = {layer.kind for layer in of_data}
        new = [Layer(kind, kind, LAYERS[kind].formats[0], small=of_data[0].small) for kind in wanted]
        of_data = of_data if kinds == set(wanted) else new
    others = [layer for layer in layers if layer.kind not in ("data", *DATA_TILE_KINDS)]
    for layer in sorted([*others, *of_data], key=lambda layer: list(LAYERS).index(layer.kind)):
        if request.ao is False and layer.kind == "ao":
            continue
        changed = layer if request.small is None else replace(layer, small=request.small)
        if request.color is not None and layer.kind == "color":
            quality = (layer.quality or LayerDetails().quality) if request.color in LOSSY else None
            changed = replace(changed, format=request.color, quality=quality)
        yield changed


def _is_outgrown(record: RenderingRecord, new: Sequence[ViewAngles], box: Box) -> bool:
    """Whether content has left the frames, or a new view does not fit the rendering's square."""
    try:
        for frame in record.frames:
            check_content(frame, box, record.window)
        for view in new:
            pin_into(record.frames[0], record.box, view, record.window)
    except OutsideFrame:
        return True
    return False


def _data(record: RenderingRecord) -> DataEncoding:
    return "tile" if _has(record, "data") else "png"


def _has(record: RenderingRecord, kind: LayerKind) -> bool:
    return any(layer.kind == kind for layer in record.layers)
