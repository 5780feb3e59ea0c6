"""Keys of stored images: hashes of everything that an image depends on."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from map3d import _core
from map3d.portrayal.cameras import ViewCamera
from map3d.portrayal.encodings import Background
from map3d.portrayal.image_formats import ImageFormat, ImageLayer
from map3d.portrayal.selection import Selection
from map3d.portrayal.styles import DEFAULT_STYLE
from map3d.types import Vec3

FORMAT: Final = 1
"""Raised when the service encodes the same view differently."""
AO_RADIUS_M: Final = 10.0


@dataclass(frozen=True)
class SceneView:
    """What one scene contributes to a view. `pages`: of object ids; `version`: of the scene; `sun`: unit vector in local axes;
    `style`: of its colours."""

    scene: str
    version: str
    folder: str
    registry: str
    camera: ViewCamera
    selection: Selection
    pages: tuple[int, ...]
    sun: Vec3
    style: str = DEFAULT_STYLE


@dataclass(frozen=True)
class ImageRequest:
    """One image layer of a view in one format."""

    layer: ImageLayer
    format: ImageFormat
    quality: int


def image_key(views: Sequence[SceneView], image: ImageRequest, background: Background) -> str:
    """Returns the key of an image. Leaves out what the image layer does not depend on."""
    value = {
        "format": [FORMAT, _core.RENDER_FORMAT],
        "image": [image.layer.name, str(image.format), image.quality if image.format.lossy else 0],
        "background": [list(background.color), background.transparent] if image.layer.name == "COLOR" else None,
        "views": [_view_value(view, image.layer) for view in views],
    }
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:48]


def _view_value(view: SceneView, layer: ImageLayer) -> list[Any]:
    depends = [
        view.camera.depth_zero_m if layer.name == "DEPTH" else None,
        list(view.sun) if layer.name == "SUN" else None,
        AO_RADIUS_M if layer.name == "AO" else None,
        list(view.pages) if layer.name == "OBJECTID" else None,
        view.style if layer.name == "COLOR" else None,
    ]
    return [view.scene, view.version, view.camera.to_json(), view.selection.to_json(), depends]
