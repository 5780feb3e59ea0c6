"""Requests about renderings: create, add views and layers, estimate, render."""

from dataclasses import dataclass
from datetime import date, datetime
from typing import Any, Final

from map3d import _core
from map3d.errors import BadRequest
from map3d.geometry.sun import GeographicPosition, SunAngles
from map3d.geometry.views import DEFAULT_PITCH_DEG, views_around
from map3d.requests.param import param
from map3d.requests.scenes import ContentChoice, WorkLimits
from map3d.types import (
    AO_RADIUS_M,
    COLOR_FORMATS,
    DEEPEST_LEVEL,
    DEFAULT_DATA,
    LAYER_KINDS,
    LAYERS_BY_DATA,
    TILE_PX,
    DataEncoding,
    ViewAngles,
)

DEFAULT_DIRECTIONS: Final = 4
DEFAULT_RADIUS_M: Final = 20.0
LEAST_RES_M: Final = 1e-6
MAX_DIRECTIONS: Final = 360

_NO_CLUSTER: Final = "only the command line knows Dask clusters"

Window = tuple[float, float, float]
"""x and y of the centre in the scene's CRS, and the side of the square, metres."""


def data_param(*default: Any, before: str = "", words: str = "") -> Any:
    """Declares how normal, id and depth are stored. `before`: words before the help."""
    tile = f"{before}store normal, id and depth as one layer of data tiles (tile), "
    about = f"{tile[0].upper()}{tile[1:]}or in more than twice the bytes as three PNG layers, which any program reads (png)."
    choices = tuple(LAYERS_BY_DATA)
    return param(*default, help=about, words=words, choices=choices, label="Surface directions, objects and depth as")


def small_param(default: bool | None = False, **more: Any) -> Any:
    return param(default, help="Encode for size: about 30 % fewer bytes, in three times the encoding time.", label="Encode for size", **more)


def color_param(layers: str, default: str | None = COLOR_FORMATS[0]) -> Any:
    words = "" if default else COLOR_FORMATS[0]
    return param(default, help=f"Image format of the {layers}.", words=words, choices=COLOR_FORMATS, label="Image format of colours")


def res_param(help: str, **more: Any) -> Any:
    return param(None, help=f"Metres per pixel{help}.", option="--res", minimum=LEAST_RES_M, label="Resolution in metres per pixel", **more)


@dataclass(frozen=True, kw_only=True)
class LayerDetails:
    """What layers look like: their image format, and the sun and the radius of those with light."""

    color: str = color_param("layers color and picture")
    quality: int = param(80, help="Quality of webp and jpeg.", minimum=_core.QUALITY[0], maximum=_core.QUALITY[1], label="Quality of WebP and JPEG")
    small: bool = small_param()
    time: datetime | None = param(
        None, help="Layers sun and picture: date and time with time zone, e.g. 2026-06-21T15:00+02:00.", label="Time of the shadows (UTC)"
    )
    sun: SunAngles | None = param(
        None,
        help="Layers sun and picture, instead of {time}: the sun's azimuth clockwise from true north and its elevation, in degrees.",
        example="195,60",
        label="Instead of a time: azimuth and elevation of the sun in degrees",
    )
    day: date | None = param(
        None, help="Layer sun16: the day; one sun per hour from 5 to 20, local zone time.", option="--date", label="Day of the shadows"
    )
    radius_m: float | None = param(
        None,
        help="Layers ao and picture: radius of ambient occlusion in metres.",
        words=f"{DEFAULT_RADIUS_M:g}",
        option="--ao-radius",
        minimum=AO_RADIUS_M[0],
        maximum=AO_RADIUS_M[1],
        label="Radius of ambient occlusion in metres",
    )
    place: GeographicPosition | None = param(
        None,
        help="Sun layers of a scene in local metres: its position on earth, in degrees; the y axis points north.",
        example="48.76,11.42",
        label="Scenes in local metres: latitude and longitude in degrees",
    )


_LAYERS: Final = f"Layers, each KIND or NAME=KIND. Kinds: {', '.join(LAYER_KINDS)}."


@dataclass(frozen=True, kw_only=True)
class CreateRendering(LayerDetails):
    """Creates a rendering of a scene. Exactly one of `res_m` and `levels` is set."""

    scene: str = param(help="Name of the scene.", argument=True, lacks={"library": "a method of the scene", "studio": "a page of the scene"})
    name: str = param(help="Name of the rendering.", argument=True, label="Name in addresses")
    views: tuple[ViewAngles, ...] = param(
        (),
        help="Look-at angle and pitch in degrees.",
        example="45-22.5",
        option="--view",
        maximum=MAX_DIRECTIONS,
        lacks={"studio": "the form has directions and a pitch, which the preview shows"},
    )
    directions: int | None = param(
        None,
        help="Instead of {views}: number of evenly spaced look-at angles.",
        words=f"{DEFAULT_DIRECTIONS}",
        minimum=1,
        maximum=MAX_DIRECTIONS,
        label="Directions",
    )
    pitch: tuple[float, ...] = param(
        (),
        help="Pitch for {directions}, in degrees; 90 looks straight down.",
        words=f"{DEFAULT_PITCH_DEG:g}",
        label="Pitch below the horizon",
    )
    res_m: float | None = res_param(" at the deepest level")
    levels: int | None = param(
        None, help="Instead of {res_m}: number of levels.", minimum=1, maximum=DEEPEST_LEVEL + 1, label="Instead of a resolution: number of levels"
    )
    window: Window | None = param(
        None,
        help="Render only a square of SIZE metres in each view, centred on the ground point X, Y in the scene's coordinate system.",
        example="691000,5336000,2000",
        label="Only a square: x and y of its centre in the scene's coordinate system, and its side in metres",
    )
    layers: tuple[str, ...] | None = param(None, help=_LAYERS, words=",".join(LAYERS_BY_DATA[DEFAULT_DATA]), minimum=1, label="Layers")
    data: DataEncoding | None = data_param(None, before="Instead of {layers}: ", words=DEFAULT_DATA)
    tile_px: int = param(256, help="Side of a tile in pixels.", option="--tile-size", choices=TILE_PX, label="Side of a tile in pixels")
    title: str = param("", help="Display title.", words="the scene's", label="Title")
    attribution: str = param("", help="Attribution text.", words="the scene's", label="Attribution")
    tiles: str | None = param(
        None,
        help="Store the tiles in a folder or an object store, as file:///FOLDER or s3://BUCKET/PREFIX; credentials come from the environment.",
        words="SQLite files in the workspace",
        metavar="URL",
        lacks=dict.fromkeys(("rest", "studio"), "an editor may not make the server write to any address"),
    )
    regrid: bool = param(
        False,
        help="Replace the frames of an existing rendering to fit the current scene; everything is rendered again.",
        lacks=dict.fromkeys(("rest", "studio"), "over the web, a rendering is removed and created again"),
    )

    def angles(self) -> tuple[ViewAngles, ...]:
        """Returns the views. Raises BadRequest for views beside directions or pitch."""
        if self.views and (self.directions is not None or self.pitch):
            raise BadRequest(f"rendering {self.name}: give either views, or directions and pitch")
        return self.views or views_around(self.directions or DEFAULT_DIRECTIONS, self.pitch or (DEFAULT_PITCH_DEG,))

    def layer_names(self) -> tuple[str, ...]:
        """Returns KIND or NAME=KIND of each layer: without `layers`, color with normal, id and depth as `data` says. Raises BadRequest for both."""
        if self.layers is None:
            return LAYERS_BY_DATA[self.data or DEFAULT_DATA]
        if self.data is not None:
            raise BadRequest("give either --layers or --data; in --layers, the kind data is the data tile and normal, id and depth are PNG layers")
        return self.layers


@dataclass(frozen=True, kw_only=True)
class MapTexts:
    """What a map says of itself, and how it opens; None leaves a member as it is."""

    title: str | None = param(None, help="Display title; empty for the scene's.", label="Title")
    attribution: str | None = param(None, help="Attribution text; empty for the scene's.", label="Attribution")
    description: str | None = param(
        None, help="Description of the map for search engines and links; empty for the number of views.", label="Description for links"
    )
    start_view: ViewAngles | None = param(
        None, help="View in which the map opens: look-at angle and pitch in degrees.", example="45-22.5", label="View in which the map opens"
    )


@dataclass(frozen=True, kw_only=True)
class ChangeRendering(MapTexts):
    """Changes what the map of a rendering says and how it opens. Nothing is rendered."""


@dataclass(frozen=True, kw_only=True)
class BuildMemory:
    """The memory of a build."""

    max_memory_bytes: int | None = param(None, help="Memory for the build.", example="2G", words="2G", option="--max-memory", minimum=1, is_size=True)


@dataclass(frozen=True, kw_only=True)
class BuildAndCreateRendering(CreateRendering, ContentChoice, BuildMemory):
    """Builds the scene if it has changed, and creates a rendering of it. The command line does both at once."""


@dataclass(frozen=True, kw_only=True)
class AddViews:
    """Adds views to a rendering."""

    views: tuple[ViewAngles, ...] = param(help="Look-at angle and pitch in degrees.", example="45-22.5", option="--view")


@dataclass(frozen=True, kw_only=True)
class AddLayers(LayerDetails):
    """Adds layers to all views of a rendering."""

    layers: tuple[str, ...] = param(help=_LAYERS, minimum=1)


@dataclass(frozen=True, kw_only=True)
class Estimate(WorkLimits):
    """Estimates a rendering before it is rendered."""


@dataclass(frozen=True, kw_only=True)
class Render(WorkLimits):
    """Renders the missing and changed tiles."""

    retry_quarantined: bool = param(False, help="Render the blocks in quarantine once more.", lacks={"cli": "map3d retry opens them again"})
    dask: str | None = param(
        None,
        help="Render on the Dask cluster with this scheduler, e.g. tcp://10.0.0.1:8786, instead of here.",
        metavar="ADDRESS",
        lacks=dict.fromkeys(("rest", "library", "studio"), _NO_CLUSTER),
    )
    dask_workspace: str | None = param(
        None,
        help="Workspace folder on the Dask workers.",
        words="the same path as here",
        metavar="FOLDER",
        lacks=dict.fromkeys(("rest", "library", "studio"), _NO_CLUSTER),
    )
    plan_only: bool = param(
        False,
        help="Build the scene and plan the blocks, but render none.",
        lacks=dict.fromkeys(("rest", "library", "studio"), "only the command line starts runs whose blocks other processes render"),
    )
