"""Creates scenes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from map3d.catalogue import Catalogue, SceneCrs, SceneRecord, Workspace
from map3d.errors import BadRequest
from map3d.ingest.content import CLUSTER, KEEP_OUTLIERS
from map3d.ingest.scene_crs import parse_scene_crs
from map3d.renderings.build import OPTIONS
from map3d.renderings.remove_scene import finish_scene_removal
from map3d.renderings.shared_scene import FILES, check_files_url
from map3d.renderings.style import STYLE, Rules
from map3d.types import check_name

GROUND_PLANES: Final = ("auto", "on", "off")


@dataclass(frozen=True)
class SceneRequest:
    """`crs`: such as EPSG:25832, "local" for local metres, None for that of the first file; `files`: URL of the store from which other nodes fetch
    the built scene; `keep_outliers`: keep content however far it is from the rest; `cluster`: the group of content to build, 0 for the largest;
    `style`: rules of colours; `options`: build options that differ from their default (`build.OPTIONS`)."""

    name: str
    title: str = ""
    attribution: str = ""
    crs: str | None = None
    ground_plane: str = "auto"
    files: str | None = None
    options: Mapping[str, bool] = field(default_factory=dict)
    keep_outliers: bool = False
    cluster: int = 0
    style: Rules = field(default_factory=list)

    def check(self) -> None:
        """Raises BadName, CrsError, BadRequest."""
        check_name(self.name, "scene")
        self.build_options()
        self.pinned_crs()

    def pinned_crs(self) -> SceneCrs | None:
        return None if self.crs is None else parse_scene_crs(self.crs)

    def build_options(self) -> dict[str, Any]:
        """Raises BadRequest for an unknown option."""
        switches = {name: value for name, value in OPTIONS.items() if isinstance(value, bool)}
        unknown = sorted(set(self.options) - set(switches))
        if unknown:
            raise BadRequest(f"scene {self.name}: unknown build option {', '.join(unknown)}; known are {', '.join(switches)}")
        if self.ground_plane not in GROUND_PLANES:
            raise BadRequest(f"scene {self.name}: ground plane is {self.ground_plane!r}, expected {', '.join(GROUND_PLANES)}")
        shared = {} if self.files is None else {FILES: check_files_url(self.files)}
        chosen = {name: value for name, value in ((KEEP_OUTLIERS, self.keep_outliers), (CLUSTER, self.cluster), (STYLE, self.style)) if value}
        return {**switches, **self.options, "ground_plane": self.ground_plane, **chosen, **shared}


def create_scene(workspace: Workspace, catalogue: Catalogue, request: SceneRequest) -> SceneRecord:
    """Creates an empty scene. Raises AlreadyExists, BadName, CrsError, BadRequest."""
    request.check()
    finish_scene_removal(workspace, catalogue, request.name)
    options = request.build_options()
    catalogue.create_scene(SceneRecord(request.name, request.title, request.attribution, crs=request.pinned_crs(), options=options))
    return catalogue.scene(request.name)
