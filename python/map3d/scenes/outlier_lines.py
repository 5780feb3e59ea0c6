"""What a build left out, in lines for people: on the command line, in logs, on pages and in reports."""

from collections.abc import Iterator
from typing import Final

from pyproj import Transformer

from map3d.catalogue import SceneCrs
from map3d.geometry.crs import horizontal_crs, parse_crs
from map3d.geometry.places import find_place
from map3d.ingest.content import Cluster
from map3d.messages import Message, message
from map3d.number_formats import distance
from map3d.scenes.outliers import FileOutliers, Outliers
from map3d.types import Box

MAX_FILES: Final = 10
MAX_CLUSTERS: Final = 10


def outlier_lines(outliers: Outliers, crs: SceneCrs | None) -> list[Message]:
    """Returns a warning with what was left out, by file, and the clusters with the options that choose among them; nothing when all content is in one
    place."""
    places = len(outliers.clusters)
    if not outliers.clusters or (not outliers.files and places < 2):
        return []
    if not outliers.files:
        return [message("places-all-kept", count=places), *_cluster_lines(outliers, crs)]
    others = [cluster.number for cluster in outliers.clusters if cluster.number not in outliers.kept]
    if not others:
        return [*_file_lines(outliers), message("keep-outliers-keeps-all")]
    choice = message("keep-outliers-or-cluster", number=others[0])
    return [*_file_lines(outliers), message("places-far-apart", count=places), *_cluster_lines(outliers, crs), choice]


def file_line(file: FileOutliers) -> Message:
    names = [item.name if item.whole else message("in-part", name=item.name) for item in file.examples]
    more = [message("more-names", count=file.objects - len(names))] if file.objects > len(names) else []
    return message("left-out-of-file", source=file.source, triangles=file.triangles, distance=file.distance_m, names=[*names, *more])


def cluster_message(cluster: Cluster, crs: SceneCrs | None) -> Message:
    width, depth = (cluster.box[1][k] - cluster.box[0][k] for k in (0, 1))
    counts = {"objects": cluster.objects, "triangles": cluster.triangles}
    return message("files-at-place", **counts, width=width, depth=depth, place=middle_of(cluster.box, crs))


def middle_of(box: Box, crs: SceneCrs | None) -> Message:
    """Returns the middle of a box in world coordinates, and where on Earth that is if the CRS says so."""
    x, y = ((box[0][k] + box[1][k]) / 2 for k in (0, 1))
    position = {"x": round(x), "y": round(y)}
    if crs is not None and crs.wkt is not None:
        lon, lat = Transformer.from_crs(horizontal_crs(parse_crs(crs.wkt)), "EPSG:4326", always_xy=True).transform(x, y)
        if -180 <= lon <= 180 and -90 <= lat <= 90:
            return message("position-and-place", **position, place=find_place(lon, lat).message)
    return message("position", **position)


def extent_text(box: Box) -> str:
    return " × ".join(distance(box[1][k] - box[0][k], "en") for k in (0, 1))


def box_text(box: Box) -> str:
    """Returns the extent with the heights."""
    return f"{extent_text(box)}, heights {box[0][2]:z,.1f} to {box[1][2]:z,.1f} m"


def _file_lines(outliers: Outliers) -> Iterator[Message]:
    yield message("left-out", triangles=outliers.triangles, objects=sum(file.objects for file in outliers.files))
    for file in outliers.farthest_first[:MAX_FILES]:
        yield file_line(file)
    if len(outliers.files) > MAX_FILES:
        yield message("left-out-more-files", count=len(outliers.files) - MAX_FILES)


def _cluster_lines(outliers: Outliers, crs: SceneCrs | None) -> Iterator[Message]:
    for cluster in outliers.clusters[:MAX_CLUSTERS]:
        code = "place-kept" if cluster.number in outliers.kept else "place-left-out"
        yield message(code, number=cluster.number, files=cluster_message(cluster, crs))
    if len(outliers.clusters) > MAX_CLUSTERS:
        yield message("more-places", count=len(outliers.clusters) - MAX_CLUSTERS)
