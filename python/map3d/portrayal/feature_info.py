"""GetFeatureInfo: finds objects by ray, position or id, and reads their attributes from the registry (OGC 15-001r4 §11)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from map3d.catalogue import Workspace
from map3d.geometry.views import Axes
from map3d.portrayal.cameras import ViewCamera, to_camera
from map3d.portrayal.contents import ChosenLayers, Contents
from map3d.portrayal.requests import DEFAULT_FEATURES, MAX_FEATURES, InfoByObjectId, InfoByPosition, InfoByRay
from map3d.portrayal.selection import Selection
from map3d.portrayal.service_exception import ServiceException
from map3d.portrayal.service_state import to_service_id
from map3d.portrayal.views import ViewService, tracer_view
from map3d.registry import RegisteredObject, Registry
from map3d.types import Vec3

DEFAULT_TOLERANCE_M: Final = 1.0
MAX_HITS: Final = 4096
MAX_ANCESTORS: Final = 16


@dataclass(frozen=True)
class Feature:
    """An object that was found. `ancestors`: the objects that it is part of, nearest first."""

    object_id: int
    layer: str
    object: RegisteredObject
    ancestors: tuple[RegisteredObject, ...] = ()


class FeatureInfo:
    """Threads may share it."""

    def __init__(self, workspace: Workspace, views: ViewService) -> None:
        self._workspace, self._views = workspace, views

    def by_ray(self, request: InfoByRay, contents: Contents) -> list[Feature]:
        """Returns the objects under a pixel, nearest first, at most `feature_count` per layer. Raises ServiceException."""
        found: list[Feature] = []
        for layers in contents.choose(request.layers, info=True):
            crs = layers.scene.systems.find(request.crs, info=True)
            camera = to_camera(request.projection, crs, request.width_px, request.height_px, "projection")
            view = self._tracer_view(layers, camera)
            task = {"kind": "ray", "view": view, "x_px": request.x_px, "y_px": request.y_px, "count": MAX_HITS}
            found += self._trace(layers, task, _layer_count(request.feature_count), request.layers)
        return found

    def by_position(self, request: InfoByPosition, contents: Contents) -> list[Feature]:
        """Returns the objects nearest to a position, at most `feature_count` per layer. Raises ServiceException."""
        found: list[Feature] = []
        for layers in contents.choose(request.layers, info=True):
            position = layers.scene.systems.find(request.crs, info=True).to_local(request.position, "coordinate")
            tolerance_m = DEFAULT_TOLERANCE_M if request.tolerance_m is None else request.tolerance_m
            view = self._tracer_view(layers, _any_camera(position))
            task = {"kind": "position", "view": view, "position": list(position), "tolerance_m": tolerance_m}
            found += self._trace(layers, task, _layer_count(request.feature_count), request.layers)
        return found

    def by_object_id(self, request: InfoByObjectId, contents: Contents) -> list[Feature]:
        """Returns the objects with the given ids, in that order, as far as they belong to the layers. Raises ServiceException."""
        allowed = {layers.scene.identifier: layers for layers in contents.choose(request.layers, info=True)}
        if not any(request.layers):
            allowed = {scene.identifier: ChosenLayers(scene, None, {}) for scene in contents.scenes}
        found = []
        for object_id in request.object_ids:
            place = self._views.state.scene_of(object_id)
            layers = None if place is None else allowed.get(place[0])
            if place is not None and layers is not None:
                found += self._features(layers, [place[1]], 1, ())
        return found

    def _tracer_view(self, layers: ChosenLayers, camera: ViewCamera) -> dict[str, Any]:
        selection = Selection(assets=layers.assets)
        return tracer_view(self._views.scene_view(layers, camera, selection))

    def _trace(self, layers: ChosenLayers, task: dict[str, Any], count: int, names: Sequence[str]) -> list[Feature]:
        response = self._views.pool.submit(layers.scene.identifier, task).result()
        return self._features(layers, (int(number) for number, _ in response.value["objects"]), count, names)

    def _features(self, layers: ChosenLayers, numbers: Iterable[int], count: int, names: Sequence[str]) -> list[Feature]:
        """Returns the distinct objects, at most `count` per layer, the layers in the order of `names`."""
        scene = layers.scene
        pages = self._views.state.pages(scene.identifier, scene.greatest_id)
        found: list[Feature] = []
        with Registry(self._workspace.registry_path(scene.identifier)) as registry:
            per_layer: dict[str, int] = {}
            for number in dict.fromkeys(numbers):
                item = registry.get(number)
                if item is None or (layers.assets is not None and item.asset not in layers.assets):
                    continue
                layer = f"{scene.identifier}/{item.asset}"
                counted = layer if layer in names else scene.identifier
                if per_layer.get(counted, 0) < count:
                    per_layer[counted] = per_layer.get(counted, 0) + 1
                    found.append(Feature(to_service_id(number, pages), layer, item, _ancestors(registry, item)))
        order = {name: place for place, name in enumerate(names)}
        return sorted(found, key=lambda feature: order.get(feature.layer, -1))


def _layer_count(requested: int | None) -> int:
    return min(DEFAULT_FEATURES if requested is None else requested, MAX_FEATURES)


def _ancestors(registry: Registry, item: RegisteredObject) -> tuple[RegisteredObject, ...]:
    found: list[RegisteredObject] = []
    parent = item.parent
    while parent is not None and len(found) < MAX_ANCESTORS and parent not in [one.id for one in found]:
        above = registry.get(parent)
        if above is None:
            break
        found.append(above)
        parent = above.parent
    return tuple(found)


def _any_camera(position: Vec3) -> ViewCamera:
    """Returns a camera for requests that need none."""
    return ViewCamera("orthographic", position, Axes((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)), (-1.0, 1.0, -1.0, 1.0), 0.0, 1.0, 1, 1)


def check_found(features: Sequence[Feature], request: InfoByObjectId) -> None:
    """Raises InvalidParameterValue if none of the requested ids exists."""
    if not features:
        raise ServiceException("InvalidParameterValue", "objectId: no object of the layers has one of these ids", "objectId")
