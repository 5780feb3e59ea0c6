"""`map3d inspect`: imports files into a workspace of their own that is removed at once, and says what they hold."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from map3d.catalogue import Catalogue, SceneCrs, SceneRecord, Workspace
from map3d.coherence.import_files import OnFile, import_files
from map3d.ingest.content import Cluster, find_content
from map3d.ingest.import_options import ImportOptions
from map3d.messages import Message
from map3d.scenes.file_contents import FileContents, file_contents, union
from map3d.types import Box

_SCENE: Final = "inspect"


@dataclass(frozen=True)
class Inspection:
    """`crs`: that of the scene which an import of the files makes; `box`: of all files, in that CRS. `clusters`: groups of content far from each
    other, largest first; empty when everything is in one place. `failed`: (file, reason); `ignored`: (file, what it is)."""

    crs: SceneCrs | None
    box: Box | None
    files: tuple[FileContents, ...]
    clusters: tuple[Cluster, ...]
    failed: tuple[tuple[str, Message], ...]
    ignored: tuple[tuple[str, str], ...]


def inspect_files(paths: Sequence[Path], options: ImportOptions, progress: OnFile | None = None) -> Inspection:
    """Reads the files, and all files in known formats of the folders, as an import into one scene does. Leaves nothing behind.

    Raises NotFound, UnknownFormat, and for a single file the errors of `import_file`.
    """
    with TemporaryDirectory(prefix="map3d-inspect-") as folder:
        workspace = Workspace(Path(folder), catalogue_url=str(Path(folder) / "catalogue.sqlite"))
        with workspace.open_catalogue() as catalogue:
            catalogue.create_scene(SceneRecord(_SCENE))
            imported = import_files(workspace, catalogue, _SCENE, paths, options, progress=progress)
            files = tuple(file_contents(workspace, catalogue, _SCENE))
            clusters = _clusters(workspace, catalogue)
            crs = catalogue.scene(_SCENE).crs
    return Inspection(crs, union([file.box for file in files]), files, clusters, tuple(imported.failed), tuple(imported.ignored))


def _clusters(workspace: Workspace, catalogue: Catalogue) -> tuple[Cluster, ...]:
    origin = catalogue.scene(_SCENE).origin
    if origin is None:
        return ()
    found = find_content([workspace.asset_folder(_SCENE, asset.name) for asset in catalogue.assets(_SCENE)], origin, {})
    return found.clusters if len(found.clusters) > 1 else ()
