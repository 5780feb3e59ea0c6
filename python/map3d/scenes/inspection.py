"""`map3d inspect`: imports files into a workspace of their own that is removed at once, and says what they hold."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from map3d.catalogue import Catalogue, SceneCrs, SceneRecord, Workspace
from map3d.coherence.import_files import OnFile, import_files
from map3d.ingest.content import Cluster
from map3d.ingest.file_notes import FileNote
from map3d.ingest.import_options import ImportOptions
from map3d.messages import Message
from map3d.registry import Registry
from map3d.scenes.file_contents import FileContents, file_contents, union
from map3d.scenes.outliers import OutlierCheck, Outliers, read_outliers
from map3d.scenes.texture_faults import report_damaged_images
from map3d.types import Box

_SCENE: Final = "inspect"


@dataclass(frozen=True)
class Inspection:
    """`crs`: that of the scene which an import of the files makes; `box`: of all files, in that CRS. `clusters`: groups of content far from each
    other, largest first; empty when everything is in one place, without the strays in `left_out`. `failed`: (file, reason); `ignored`: files of the
    folders that are no documents of their own."""

    crs: SceneCrs | None
    box: Box | None
    files: tuple[FileContents, ...]
    clusters: tuple[Cluster, ...]
    failed: tuple[tuple[str, Message], ...]
    ignored: tuple[FileNote, ...]
    left_out: Outliers


def inspect_files(paths: Sequence[Path], options: ImportOptions, progress: OnFile | None = None) -> Inspection:
    """Reads the files, and all files in known formats of the folders, as an import into one scene does. Leaves nothing behind.

    Raises NotFound, UnknownFormat, and for a single file the errors of `import_file`.
    """
    with TemporaryDirectory(prefix="map3d-inspect-") as folder:
        workspace = Workspace(Path(folder), catalogue_url=str(Path(folder) / "catalogue.sqlite"))
        with workspace.open_catalogue() as catalogue:
            catalogue.create_scene(SceneRecord(_SCENE))
            imported = import_files(workspace, catalogue, _SCENE, paths, options, progress=progress)
            clusters = _find_clusters(workspace, catalogue)
            report_damaged_images(workspace, catalogue, _SCENE)
            files = tuple(file_contents(workspace, catalogue, _SCENE))
            left_out = read_outliers(workspace, _SCENE)
            crs = catalogue.scene(_SCENE).stated_crs
    box = union([file.box for file in files])
    return Inspection(crs, box, files, clusters, tuple(imported.failed), tuple(imported.ignored), left_out)


def _find_clusters(workspace: Workspace, catalogue: Catalogue) -> tuple[Cluster, ...]:
    """Returns the clusters if there are several; leaves out of a single one what a build does."""
    scene = catalogue.scene(_SCENE)
    if scene.origin is None:
        return ()
    check = OutlierCheck(workspace, scene, catalogue.assets(_SCENE), {})
    if len(check.content.clusters) > 1:
        return check.content.clusters
    if check.content.extent is not None:
        with Registry(workspace.registry_path(_SCENE)) as registry:
            check.finish(registry)
    return ()
