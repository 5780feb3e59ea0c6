"""A workspace of the library."""

from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Self

from map3d.catalogue import Catalogue, Workspace
from map3d.library.library_rendering import LibraryRendering
from map3d.library.library_scene import LibraryScene
from map3d.renderings.create_scene import SceneRequest, create_scene


def open_workspace(folder: str | PathLike[str], *, catalogue: str | None = None, create: bool = True) -> "LibraryWorkspace":
    """Opens the workspace in a folder. `catalogue`: URL of its catalogue, such as mongodb://HOST/CITY, instead of the file in the folder or the URL
    that the folder names; `create`: creates the folder when it does not exist.

    Raises NotFound without a folder, BadRequest for an invalid URL, StoreError when the catalogue cannot be reached.
    """
    workspace = Workspace(Path(folder), catalogue)
    if create:
        workspace.create()
    return LibraryWorkspace(workspace, workspace.open_catalogue())


class LibraryWorkspace:
    """Scenes and renderings. Close it at the end, or use it as a context. Safe to share between threads."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue) -> None:
        self._workspace, self._catalogue = workspace, catalogue

    @property
    def folder(self) -> Path:
        return self._workspace.root

    def create_scene(
        self,
        name: str,
        *,
        crs: str | None = None,
        title: str = "",
        attribution: str = "",
        ground_plane: str = "auto",
        files: str | None = None,
        **build_options: bool,
    ) -> LibraryScene:
        """Creates an empty scene. `crs`: such as EPSG:25832, or "local"; by default that of the first file. `files`: URL at which the built scene is
        shared with other nodes. `build_options`: merge_vertices, merge_faces, drop_degenerate, merge_materials, drop_untextured.

        Raises AlreadyExists, BadName, CrsError, BadRequest.
        """
        create_scene(self._workspace, self._catalogue, SceneRequest(name, title, attribution, crs, ground_plane, files, build_options))
        return LibraryScene(self._workspace, self._catalogue, name)

    def scene(self, name: str) -> LibraryScene:
        """Raises NotFound."""
        return LibraryScene(self._workspace, self._catalogue, self._catalogue.scene(name).name)

    def scenes(self) -> list[LibraryScene]:
        """Returns all scenes, ordered by name."""
        return [LibraryScene(self._workspace, self._catalogue, record.name) for record in self._catalogue.scenes()]

    def rendering(self, name: str) -> LibraryRendering:
        """Raises NotFound."""
        return LibraryRendering(self._workspace, self._catalogue, self._catalogue.rendering(name).name)

    def renderings(self) -> list[LibraryRendering]:
        """Returns all renderings, ordered by name."""
        return [LibraryRendering(self._workspace, self._catalogue, record.name) for record in self._catalogue.renderings()]

    def close(self) -> None:
        self._catalogue.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<map3d workspace {str(self.folder)!r}>"
