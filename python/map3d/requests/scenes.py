"""Requests about scenes: create, build."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from map3d.cores import usable_cores
from map3d.requests.param import param

_ON_THE_PAGE: Final = "the scene's page offers the places once files lie far from each other"
_A_FILE: Final = "a style is a file, for which forms have no field"
_ONE_PROCESS_PER_CORE: Final = "the server decides how much of its host an operation takes"

GROUND_PLANES: Final = ("auto", "on", "off")

Style = Mapping[str, Any]
"""The content of a style file: {"rules": [...]}."""


@dataclass(frozen=True, kw_only=True)
class ContentChoice:
    """What a build keeps and how it colours it; None leaves a choice as it is."""

    keep_outliers: bool | None = param(
        None,
        help="Keep content far from the rest.",
        words="leave it out",
        option="--keep-outliers/--no-keep-outliers",
        lacks={"studio": _ON_THE_PAGE},
    )
    cluster: int | None = param(
        None,
        help="Of files in places far from each other, build the place with this number; 0 is the largest.",
        words="the largest",
        minimum=0,
        lacks={"studio": _ON_THE_PAGE},
    )
    style: Style | None = param(
        None,
        help="Style (JSON): colours for surfaces that have none of their own; without rules, the built-in ones.",
        metavar="FILE|none",
        lacks={"studio": _A_FILE},
    )


@dataclass(frozen=True, kw_only=True)
class WorkLimits:
    """How much of a host the work may take."""

    workers: int | None = param(
        None, help="Number of parallel processes.", words="one per core", minimum=1, maximum=512, lacks={"studio": _ONE_PROCESS_PER_CORE}
    )
    max_memory_bytes: int | None = param(
        None,
        help="Memory for all processes together.",
        example="2G",
        words="512M of cache per process",
        option="--max-memory",
        minimum=1,
        is_size=True,
        lacks={"studio": _ONE_PROCESS_PER_CORE},
    )

    @property
    def processes(self) -> int:
        return self.workers or usable_cores()


def _step(effect: str, *, on: bool, name: str) -> Any:
    return param(on, help=f"Build step: {effect}.", label=f"Build step: {effect}", option=f"--{name}/--no-{name}")


@dataclass(frozen=True, kw_only=True)
class BuildSteps:
    merge_vertices: bool = _step("merge duplicate vertices", on=True, name="merge-vertices")
    merge_faces: bool = _step("drop duplicate faces of the same object and material", on=True, name="merge-faces")
    drop_degenerate: bool = _step("drop triangles with zero area", on=True, name="drop-degenerate")
    merge_materials: bool = _step("merge equal materials", on=True, name="merge-materials")
    drop_untextured: bool = _step("drop faces without a texture", on=False, name="drop-untextured")


@dataclass(frozen=True, kw_only=True)
class CreateScene(ContentChoice, BuildSteps):
    """Creates an empty scene."""

    name: str = param(help="Name of the scene.", argument=True, label="Name in addresses")
    crs: str | None = param(
        None, help="Coordinate system, e.g. EPSG:25832; 'local' for local metres.", words="that of the first file", label="Coordinate system"
    )
    title: str = param("", help="Display title.", label="Title")
    attribution: str = param("", help="Attribution text.", label="Attribution")
    ground_plane: str = param(
        "auto", help="Ground plane; auto adds it to scenes without terrain.", choices=GROUND_PLANES, label="Ground below the buildings"
    )
    files: str | None = param(
        None,
        help="Share the built scene with other nodes: upload its files to a folder or an object store, as file:///FOLDER or s3://BUCKET/PREFIX.",
        metavar="URL",
        lacks=dict.fromkeys(("rest", "studio"), "an editor may not make the server write to any address"),
    )


@dataclass(frozen=True, kw_only=True)
class Build(ContentChoice, WorkLimits):
    """Builds a scene if its files, or what it keeps of them, have changed."""
