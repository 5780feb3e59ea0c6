"""The core's frames. Without NumPy, so that a subprocess that only renders starts quickly."""

from collections.abc import Mapping
from typing import Any

from map3d import _core


def core_frame(fields: Mapping[str, Any]) -> _core.Frame:
    """Returns the core's frame of the fields that `PinnedFrame.to_json` returned."""
    return _core.Frame(**{**fields, "layers": [_core.LayerSpec(**layer) for layer in fields["layers"]]})
