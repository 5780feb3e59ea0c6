"""Content that a scene leaves out since it lies far from the rest, and the places among which its editor may choose, in words."""

from dataclasses import dataclass
from typing import Final

from map3d.catalogue import SceneRecord
from map3d.ingest.content import CLUSTER, KEEP_OUTLIERS
from map3d.scenes.outlier_lines import cluster_message, file_line
from map3d.scenes.outliers import Outliers
from map3d.web.pages.language import language

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
    clusters = outliers.clusters if len(outliers.clusters) > 1 else ()
    if not outliers.files and not clusters and not keeps_all and not has_choice:
        return None
    files = outliers.farthest_first
    return OutlierWords(
        triangles=outliers.triangles,
        files=tuple(file_line(file).text(language()) for file in files[:MAX_FILES]),
        more=len(files[MAX_FILES:]),
        places=tuple(
            ClusterChoice(cluster.number, cluster_message(cluster, scene.crs).text(language()), cluster.number in outliers.kept, cluster.objects == 0)
            for cluster in clusters[:MAX_PLACES]
        ),
        keeps_all=keeps_all,
        has_choice=has_choice,
    )
