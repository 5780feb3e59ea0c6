"""The Python library (docs/python.md): workspaces, scenes and renderings as objects. It calls the functions that the command line calls, and prints
nothing."""

from map3d.library.library_rendering import LibraryRendering
from map3d.library.library_scene import LibraryScene
from map3d.library.library_workspace import LibraryWorkspace, open_workspace

__all__ = ["LibraryRendering", "LibraryScene", "LibraryWorkspace", "open_workspace"]
