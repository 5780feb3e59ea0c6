"""What an entry of a child must be."""

from collections.abc import Callable, Sequence
from typing import Any

Tell = Callable[[Any], None]
"""Sends something to the parent on the way to the answer."""

Work = Callable[[dict[str, Any], list[bytes], Tell], tuple[dict[str, Any], Sequence[bytes]]]
"""(question, its byte strings, tell) → (answer, its byte strings). An exception is answered as a failure; the child lives on."""
