"""The unit of heights that was chosen without evidence."""

from collections.abc import Mapping
from typing import Any, Final

GUESSED: Final = "height-unit-of-plane"
"""The finding of files whose heights are read in the unit of their plane."""
FOOT_M: Final = 0.3048


def is_guessed(report: Mapping[str, Any]) -> bool:
    """Whether the heights of a file are read in the unit of its plane, for want of anything better. `report`: of an import."""
    return any(found["code"] == GUESSED for found in report.get("findings", ()))
