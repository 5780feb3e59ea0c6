"""map3d: ray-traces a 3D city model once into image tiles that any phone can show."""

import importlib
from typing import Any, Final

__version__: Final = "0.1.0"

_LIBRARY: Final = {"open_workspace": "map3d.library", "Map3dError": "map3d.errors"}
"""Names of the library that are imported on first use, so that `import map3d` takes no time."""


def __getattr__(name: str) -> Any:
    if name in _LIBRARY:
        return getattr(importlib.import_module(_LIBRARY[name]), name)
    raise AttributeError(f"module 'map3d' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_LIBRARY])
