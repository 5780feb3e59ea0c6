"""GetView: turns a request into images, from the store, from the tiles of a pyramid, or from the tracer."""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from map3d.catalogue import Workspace
from map3d.errors import NotFound
from map3d.portrayal.answers import Answer, ImagePart, image_answer
from map3d.portrayal.cameras import ViewCamera, clip_to_content, to_camera
from map3d.portrayal.contents import ChosenLayers, Contents, ContentsReader
from map3d.portrayal.encodings import Background, CannotEncode, encode_layer
from map3d.portrayal.pyramid_views import PyramidViews
from map3d.portrayal.request_crs import RequestCrs
from map3d.portrayal.requests import MAX_PIXELS, BoundingBox, GetView, Portrayal
from map3d.portrayal.selection import Selection
from map3d.portrayal.service_exception import ServiceException, invalid, quote
from map3d.portrayal.service_state import ServiceState, to_service_ids
from map3d.portrayal.styles import DEFAULT_STYLE, STYLE_KINDS, styled_color
from map3d.portrayal.tracer_pool import TracerPool
from map3d.portrayal.view_keys import ImageRequest, SceneView, image_key
from map3d.renderings.view_store import ViewStore
from map3d.types import Box, Vec3

BACKGROUNDS: Final = {"white": (255, 255, 255), "sky": (200, 221, 240), "black": (0, 0, 0)}
SUN_DEG: Final = (210.0, 45.0)
"""Azimuth clockwise from north and elevation of the sun of the SUN layer, unless requested otherwise."""
UNLIMITED_M: Final = 1e6
"""Heights of a 2D bounding box reach this far from the origin."""


@dataclass(frozen=True)
class PlannedView:
    """One portrayal: what each scene contributes, and its images with their keys."""

    views: tuple[SceneView, ...]
    images: tuple[ImageRequest, ...]
    keys: tuple[str, ...]
    background: Background


@dataclass(frozen=True)
class ViewService:
    """Answers GetView requests of a workspace. Threads may share it."""

    workspace: Workspace
    contents: ContentsReader
    state: ServiceState
    store: ViewStore
    pyramids: PyramidViews
    pool: TracerPool
    computed: list[int] = field(default_factory=lambda: [0])
    """Number of views that were traced, for tests and metrics."""

    def plan(self, request: GetView, contents: Contents) -> list[PlannedView]:
        """Checks the request against the contents and returns its views. Raises ServiceException."""
        if sum(one.width_px * one.height_px for one in request.portrayals) > MAX_PIXELS:
            raise invalid("portrayals", f"all views together have more than {MAX_PIXELS} pixels; request fewer or smaller ones")
        chosen = contents.choose(request.layers, request.lods, request.styles)
        _check_names(request)
        background = _background(request)
        return [self._plan_view(request, portrayal, chosen, background) for portrayal in request.portrayals]

    def find_stored(self, planned: Sequence[PlannedView]) -> Answer | None:
        """Returns the answer if all its images are stored."""
        parts = []
        for view in planned:
            for key, image in zip(view.keys, view.images, strict=True):
                data = self.store.get(key)
                if data is None:
                    return None
                parts.append(ImagePart(str(image.format), data))
        return image_answer(parts, _headers(planned))

    def compute(self, planned: Sequence[PlannedView]) -> Answer:
        """Computes and stores the images that are missing. Raises ServiceException."""
        parts = [part for view in planned for part in self._compute_view(view)]
        return image_answer(parts, _headers(planned))

    def _compute_view(self, view: PlannedView) -> list[ImagePart]:
        with self.store.computing(view.keys[0]):
            found = [self.store.get(key) for key in view.keys]
            missing = [image for image, data in zip(view.images, found, strict=True) if data is None]
            made = iter(self._make(view, missing) if missing else ())
            images = [next(made) if data is None else data for data in found]
            if missing:
                scenes = {one.scene for one in view.views}
                for key, data, stored in zip(view.keys, images, found, strict=True):
                    if stored is None:
                        self.store.put(key, data, scenes, lambda: self._is_current(view))
        return [ImagePart(str(image.format), data) for image, data in zip(view.images, images, strict=True)]

    def _make(self, view: PlannedView, images: Sequence[ImageRequest]) -> list[bytes]:
        return self._from_pyramid(view, images) or self._trace(view, images)

    def _from_pyramid(self, view: PlannedView, images: Sequence[ImageRequest]) -> list[bytes] | None:
        """Returns the images from stored tiles; None unless a pyramid holds the view."""
        if len(view.views) != 1:
            return None
        (only,) = view.views
        kinds = tuple(dict.fromkeys(kind for image in images for kind in image.layer.kinds))
        if only.style != DEFAULT_STYLE and "color" in kinds:
            kinds = tuple(dict.fromkeys((*kinds, *STYLE_KINDS)))
        scene = self.contents.read().scene(only.scene)
        place = None if scene is None else self.pyramids.find(only.scene, only.camera, only.selection, scene.extent, kinds)
        arrays = None if place is None else self.pyramids.read(place, kinds)
        if arrays is None:
            return None
        if "color" in arrays:
            arrays["color"] = styled_color(only.style, arrays)
        if "id" in arrays:
            arrays["id"] = to_service_ids(arrays["id"], list(only.pages))
        try:
            return [encode_layer(image.layer.name, image.format, image.quality, view.background, arrays) for image in images]
        except CannotEncode as error:
            raise ServiceException("OptionNotSupported", str(error), "portrayals") from error

    def _trace(self, view: PlannedView, images: Sequence[ImageRequest]) -> list[bytes]:
        request = {
            "kind": "view",
            "views": [tracer_view(one) for one in view.views],
            "images": [{"layer": image.layer.name, "format": str(image.format), "quality": image.quality} for image in images],
            "background": {"color": list(view.background.color), "transparent": view.background.transparent},
        }
        self.computed[0] += 1
        return self.pool.submit(view.views[0].scene, request).result().blobs

    def _is_current(self, view: PlannedView) -> bool:
        """Whether no scene was built or removed while the view was computed."""
        try:
            return all(self.contents.version(one.scene) == one.version for one in view.views)
        except NotFound:
            return False

    def _plan_view(self, request: GetView, portrayal: Portrayal, chosen: Sequence[ChosenLayers], background: Background) -> PlannedView:
        sun = sun_direction(*(request.sun or SUN_DEG))
        views = tuple(self._scene_view(request, portrayal, layers, sun) for layers in chosen)
        images = tuple(ImageRequest(*one) for one in zip(portrayal.image_layers, portrayal.formats, portrayal.qualities, strict=True))
        return PlannedView(views, images, tuple(image_key(views, image, background) for image in images), background)

    def _scene_view(self, request: GetView, portrayal: Portrayal, layers: ChosenLayers, sun: Vec3) -> SceneView:
        scene = layers.scene
        crs = scene.systems.find(request.crs)
        axes = self.pyramids.axes(scene.identifier)
        camera = to_camera(portrayal.projection, crs, portrayal.width_px, portrayal.height_px, "portrayals", axes)
        camera = clip_to_content(camera, scene.extent)
        box = None if request.bounding_box is None else local_box(request.bounding_box, layers)
        selection = Selection(
            assets=layers.assets,
            lods=tuple(sorted((asset, lod) for asset, lod in layers.lods.items() if lod is not None)),
            lod_selection=request.lod_selection if any(layers.lods.values()) else "equals",
            box=box,
            spatial=request.spatial_selection if box is not None else "overlaps",
        )
        return self.scene_view(layers, camera, selection, sun)

    def scene_view(self, layers: ChosenLayers, camera: ViewCamera, selection: Selection, sun: Vec3 = (0.0, 0.0, 1.0)) -> SceneView:
        scene = layers.scene
        return SceneView(
            scene=scene.identifier,
            version=scene.version,
            folder=str(self.workspace.scene_folder(scene.identifier).absolute()),
            registry=str(self.workspace.registry_path(scene.identifier).absolute()),
            camera=camera,
            selection=selection,
            pages=tuple(self.state.pages(scene.identifier, scene.greatest_id)),
            sun=sun,
            style=layers.style,
        )


def tracer_view(view: SceneView) -> dict[str, Any]:
    """Returns a view as the subprocess reads it."""
    return {
        "folder": view.folder,
        "version": view.version,
        "registry": str(Path(view.registry)),
        "camera": view.camera.to_json(),
        "depth_zero_m": view.camera.depth_zero_m,
        "selection": view.selection.to_json(),
        "pages": list(view.pages),
        "sun": list(view.sun),
        "style": view.style,
    }


def local_box(box: BoundingBox, layers: ChosenLayers) -> Box:
    """Returns the local box that encloses a bounding box. Raises InvalidParameterValue."""
    systems = layers.scene.systems
    try:
        crs = systems.find(box.crs)
    except ServiceException as error:
        raise invalid("boundingBox", str(error)) from error
    return _enclosing(box, crs)


def _enclosing(box: BoundingBox, crs: RequestCrs) -> Box:
    z = crs.origin[2]
    heights = (box.low[2], box.high[2]) if len(box.low) == 3 else (z - UNLIMITED_M, z + UNLIMITED_M)
    points = [crs.to_local((x, y, z), "boundingBox") for x in (box.low[0], box.high[0]) for y in (box.low[1], box.high[1]) for z in heights]
    columns = np.array(points)
    low, high = np.round(columns.min(axis=0), 6).tolist(), np.round(columns.max(axis=0), 6).tolist()
    return ((low[0], low[1], low[2]), (high[0], high[1], high[2]))


def sun_direction(azimuth_deg: float, elevation_deg: float) -> Vec3:
    """Returns the unit vector towards the sun, in grid north and local axes."""
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    level = math.cos(elevation)
    x, y, z = (round(value, 9) + 0.0 for value in (level * math.sin(azimuth), level * math.cos(azimuth), math.sin(elevation)))
    length = math.hypot(x, y, z)
    return (x / length, y / length, z / length)


def _check_names(request: GetView) -> None:
    """Raises StyleNotDefined for overall styles and DeliveryOptionNotDefined: the capabilities list none."""
    for style in request.overall_styles:
        raise ServiceException("StyleNotDefined", f"no overall style {quote(style)}; the service has none", style)
    for option in request.delivery_options:
        raise ServiceException("DeliveryOptionNotDefined", f"no delivery option {quote(option)}; the service has none", option)


def _background(request: GetView) -> Background:
    """Returns the background: Background before BackgroundColor before TransparentBackground (Table 45, note a)."""
    if request.background is not None:
        if request.background not in BACKGROUNDS:
            text = f"no background {quote(request.background)}; expected {', '.join(BACKGROUNDS)}"
            raise ServiceException("BackgroundNotDefined", text, request.background)
        return Background(BACKGROUNDS[request.background])
    if request.background_color is not None:
        return Background(request.background_color)
    return Background(transparent=request.transparent)


def _headers(planned: Sequence[PlannedView]) -> dict[str, str]:
    """Returns the headers of images that depend on the present scenes: clients ask again, and learn by the ETag that nothing changed."""
    keys = "".join(key for view in planned for key in view.keys)
    return {"Cache-Control": "no-cache", "ETag": f'"{hashlib.sha256(keys.encode()).hexdigest()[:48]}"'}
