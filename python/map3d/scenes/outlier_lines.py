"""What a build left out, in lines for people: on the command line, in logs and in reports."""

from collections.abc import Iterator
from typing import Final

from pyproj import Transformer

from map3d.catalogue import SceneCrs
from map3d.geometry.crs import horizontal_crs, parse_crs
from map3d.geometry.places import Place, find_place
from map3d.scenes.outliers import FileOutliers, Outliers
from map3d.types import Box

MAX_FILES: Final = 10
MAX_CLUSTERS: Final = 10


def outlier_lines(outliers: Outliers, crs: SceneCrs | None) -> list[str]:
    """Returns a warning with what was left out, by file, and the clusters with the options that choose among them; nothing when all content is in one
    place."""
    if not outliers.clusters or (not outliers.files and len(outliers.clusters) < 2):
        return []
    if not outliers.files:
        return [f"the files lie in {len(outliers.clusters):,} places far from each other, all of which are kept:", *_cluster_lines(outliers, crs)]
    return [*_file_lines(outliers), *_choices(outliers, crs)]


def place_text(box: Box, crs: SceneCrs | None) -> str:
    """Returns the middle of a box in world coordinates, and where on Earth that is if the CRS says so."""
    x, y = middle(box)
    place = find_middle(box, crs)
    return f"{x:,.0f}, {y:,.0f}" if place is None else f"{x:,.0f}, {y:,.0f}, {place}"


def middle(box: Box) -> tuple[float, float]:
    return (box[0][0] + box[1][0]) / 2, (box[0][1] + box[1][1]) / 2


def find_middle(box: Box, crs: SceneCrs | None) -> Place | None:
    """Returns where on Earth the middle of a box in world coordinates is, None if the CRS does not say so."""
    if crs is None or crs.wkt is None:
        return None
    lon, lat = Transformer.from_crs(horizontal_crs(parse_crs(crs.wkt)), "EPSG:4326", always_xy=True).transform(*middle(box))
    return find_place(lon, lat) if -180 <= lon <= 180 and -90 <= lat <= 90 else None


def extent_text(box: Box) -> str:
    return " × ".join(length_text(box[1][k] - box[0][k]) for k in (0, 1))


def box_text(box: Box) -> str:
    """Returns the extent with the heights."""
    return f"{extent_text(box)}, heights {box[0][2]:z,.1f} to {box[1][2]:z,.1f} m"


def length_text(metres: float) -> str:
    if metres >= 1e6:
        return f"{metres / 1000:,.0f} km"
    return f"{metres / 1000:.3g} km" if metres >= 1000 else f"{metres:.3g} m"


def _file_lines(outliers: Outliers) -> Iterator[str]:
    objects = sum(file.objects for file in outliers.files)
    yield f"left out {_count(outliers.triangles, 'triangle')} of {_count(objects, 'object')}, far from the rest:"
    for file in sorted(outliers.files, key=lambda file: (-file.distance_m, file.source))[:MAX_FILES]:
        yield f"  {file.source}: {_file_text(file)}"
    if len(outliers.files) > MAX_FILES:
        yield f"  and {_count(len(outliers.files) - MAX_FILES, 'more file')}"


def _file_text(file: FileOutliers) -> str:
    names = [item.name if item.whole else f"{item.name} (in part)" for item in file.examples]
    more = file.objects - len(names)
    listed = ", ".join(names) + (f" and {more:,} more" if more else "")
    return f"{_count(file.triangles, 'triangle')}, up to {length_text(file.distance_m)} away: {listed}"


def _choices(outliers: Outliers, crs: SceneCrs | None) -> Iterator[str]:
    others = [cluster.number for cluster in outliers.clusters if cluster.number not in outliers.kept]
    if others:
        yield f"the files lie in {len(outliers.clusters):,} places far from each other:"
        yield from _cluster_lines(outliers, crs)
    instead = f"; --cluster {others[0]} builds the place with that number instead" if others else ""
    yield f"--keep-outliers keeps everything{instead} (options of map3d site and create-rendering)"


def _cluster_lines(outliers: Outliers, crs: SceneCrs | None) -> Iterator[str]:
    for cluster in outliers.clusters[:MAX_CLUSTERS]:
        counts = f"{_count(cluster.objects, 'object')}, {_count(cluster.triangles, 'triangle')}"
        kept = cluster.number in outliers.kept
        yield f"  {cluster.number}: {counts}, {extent_text(cluster.box)} around {place_text(cluster.box, crs)}; {'kept' if kept else 'left out'}"
    if len(outliers.clusters) > MAX_CLUSTERS:
        yield f"  and {_count(len(outliers.clusters) - MAX_CLUSTERS, 'more place')}"


def _count(count: int, noun: str) -> str:
    return f"{count:,} {noun}" if count == 1 else f"{count:,} {noun}s"
