"""The built viewer as it lies in the package: its page, which opens the rendering of the folder it lies in, and what the page loads."""

from importlib.resources import files
from pathlib import Path
from typing import Final

from map3d.errors import Map3dError

PAGE: Final = "index.html"
TYPES: Final = (".d.ts", ".d.mts")


class ViewerMissing(Map3dError):
    """This installation has no viewer."""


def viewer_folder() -> Path:
    """The folder with the viewer's files; raises ViewerMissing."""
    folder = Path(str(files("map3d") / "viewer"))
    if not (folder / PAGE).is_file():
        raise ViewerMissing(
            f"the viewer is not built: {PAGE} is missing in the installed package; run `make build` in a checkout, or install a release"
        )
    return folder


def viewer_files() -> list[Path]:
    """Relative paths of what a page loads, sorted: neither hidden files nor declarations of types. Raises ViewerMissing."""
    folder = viewer_folder()
    found = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return sorted(path for path in found if not any(part.startswith(".") for part in path.parts) and not path.name.endswith(TYPES))
