"""A workspace of the library."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from map3d.catalogue import Catalogue, Workspace
from map3d.library.library_rendering import LibraryRendering
from map3d.library.library_scene import LibraryScene
from map3d.lifecycle.create_scene import create_scene
from map3d.requests import CreateScene


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
        keep_outliers: bool | None = None,
        cluster: int | None = None,
        style: Mapping[str, Any] | None = None,
        merge_vertices: bool = True,
        merge_faces: bool = True,
        drop_degenerate: bool = True,
        merge_materials: bool = True,
        drop_untextured: bool = False,
    ) -> LibraryScene:
        """Creates an empty scene. `crs`: such as EPSG:25832, or "local"; by default that of the first file. `files`: URL at which the built scene is
        shared with other nodes. `keep_outliers`, `cluster`, `style`: as for `LibraryScene.build`. The others are steps of the build.

        Raises AlreadyExists, BadName, CrsError, BadRequest.
        """
        request = CreateScene(
            name=name,
            crs=crs,
            title=title,
            attribution=attribution,
            ground_plane=ground_plane,
            files=files,
            keep_outliers=keep_outliers,
            cluster=cluster,
            style=style,
            merge_vertices=merge_vertices,
            merge_faces=merge_faces,
            drop_degenerate=drop_degenerate,
            merge_materials=merge_materials,
            drop_untextured=drop_untextured,
        )
        create_scene(self._workspace, self._catalogue, request)
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
