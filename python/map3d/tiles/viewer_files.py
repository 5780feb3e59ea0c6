"""The built viewer in the installed package: its page, which shows the rendering of its own folder, and the files that the page loads."""

from importlib.resources import files
from pathlib import Path
from typing import Final

from map3d.errors import Map3dError

PAGE: Final = "index.html"
TYPE_DECLARATIONS: Final = ".d.ts"


class ViewerMissing(Map3dError):
    """The installed package contains no viewer."""


def viewer_folder() -> Path:
    """Returns the folder with the viewer's files. Raises ViewerMissing."""
    folder = Path(str(files("map3d") / "viewer"))
    if not (folder / PAGE).is_file():
        raise ViewerMissing(
            f"the viewer is not built: {PAGE} is missing from the installed package; run `make build` in a checkout, or install a release"
        )
    return folder


def viewer_files() -> list[Path]:
    """Returns the sorted relative paths of the files that pages load: no hidden files, no type declarations. Raises ViewerMissing."""
    folder = viewer_folder()
    paths = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return sorted(path for path in paths if not any(part.startswith(".") for part in path.parts) and not path.name.endswith(TYPE_DECLARATIONS))
