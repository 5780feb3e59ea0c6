"""Content that a scene leaves out since it lies far from the rest, and the places among which its editor may choose, in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from map3d.catalogue import SceneCrs, SceneRecord
from map3d.geometry import places
from map3d.ingest.content import CLUSTER, KEEP_OUTLIERS, Cluster
from map3d.scenes.outlier_lines import find_middle, middle
from map3d.scenes.outliers import FileOutliers, Outliers
from map3d.types import Box
from map3d.web.pages.formats import decimal, distance
from map3d.web.pages.tools import translate as _

MAX_FILES: Final = 5
MAX_PLACES: Final = 5


@dataclass(frozen=True)
class ClusterChoice:
    """`number`: that of the cluster; `kept`: it is in the scene; `is_stray`: it has no whole object and is not offered."""

    number: int
    text: str
    kept: bool
    is_stray: bool


@dataclass(frozen=True)
class OutlierWords:
    """`files`: what was left out of the first files; `more`: number of other files. `keeps_all`, `has_choice`: what the next build does is not the
    default."""

    triangles: int
    files: tuple[str, ...]
    more: int
    places: tuple[ClusterChoice, ...]
    keeps_all: bool
    has_choice: bool


def outlier_words(outliers: Outliers, scene: SceneRecord) -> OutlierWords | None:
    """Returns None for a scene whose content is all in one place."""
    keeps_all, has_choice = bool(scene.options.get(KEEP_OUTLIERS)), bool(scene.options.get(CLUSTER))
    if not outliers.files and len(outliers.clusters) < 2 and not keeps_all and not has_choice:
        return None
    files = sorted(outliers.files, key=lambda file: (-file.distance_m, file.source))
    return OutlierWords(
        triangles=outliers.triangles,
        files=tuple(_file_text(file) for file in files[:MAX_FILES]),
        more=len(files[MAX_FILES:]),
        places=_places(outliers.clusters[:MAX_PLACES], outliers.kept, scene.crs) if len(outliers.clusters) > 1 else (),
        keeps_all=keeps_all,
        has_choice=has_choice,
    )


def _file_text(file: FileOutliers) -> str:
    triangles = _("1 triangle") if file.triangles == 1 else _("{count} triangles", count=file.triangles)
    values = {"file": file.source, "triangles": triangles, "distance": distance(file.distance_m), "name": file.examples[0].name}
    return _("{file}: {triangles}, up to {distance} away, e.g. of {name}", **values)


def _places(clusters: Sequence[Cluster], kept: Sequence[int], crs: SceneCrs | None) -> tuple[ClusterChoice, ...]:
    return tuple(ClusterChoice(cluster.number, _place_text(cluster, crs), cluster.number in kept, cluster.objects == 0) for cluster in clusters)


def _place_text(cluster: Cluster, crs: SceneCrs | None) -> str:
    objects = _("1 object") if cluster.objects == 1 else _("{count} objects", count=cluster.objects)
    return _("{objects}, {extent} around {place}", objects=objects, extent=_extent(cluster.box), place=_middle_text(cluster.box, crs))


def _extent(box: Box) -> str:
    return " × ".join(distance(box[1][k] - box[0][k]) for k in (0, 1))


def _middle_text(box: Box, crs: SceneCrs | None) -> str:
    x, y = middle(box)
    place = find_middle(box, crs)
    return ", ".join([decimal(x, 0), decimal(y, 0), *([] if place is None else [_town_text(place)])])


def _town_text(place: places.Place) -> str:
    town = f"{place.town.name}, {place.town.country}" if place.town.name != place.town.country else place.town.name
    if place.distance_km <= places.NEAR_KM:
        return _("near {town} ({position})", town=town, position=_position(place))
    return _("at {position}, {distance} from {town}", position=_position(place), distance=distance(place.distance_km * 1000), town=town)


def _position(place: places.Place) -> str:
    lat, lon = decimal(abs(place.lat), 3), decimal(abs(place.lon), 3)
    north = _("{degrees}° S", degrees=lat) if place.lat < 0 else _("{degrees}° N", degrees=lat)
    east = _("{degrees}° W", degrees=lon) if place.lon < 0 else _("{degrees}° E", degrees=lon)
    return f"{north}, {east}"
