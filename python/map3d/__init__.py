"""map3d: ray-traces a 3D city model once into image tiles that any phone can show."""

from typing import Final

__version__: Final = "0.1.0"
