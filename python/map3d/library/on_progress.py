"""Progress of the library's methods."""

from collections.abc import Callable

OnProgress = Callable[[str, int, int], object]
"""Called with the stage, the number of steps done, and of all; the latter is 0 if it is unknown. An exception ends the work, which can be resumed."""


def building(progress: OnProgress | None) -> Callable[[str, int, int], bool]:
    """Returns the callback of a build."""

    def show(stage: str, done: int, total: int) -> bool:
        if progress is not None:
            progress(f"building: {stage}", done, total)
        return True

    return show


def publishing(progress: OnProgress | None) -> Callable[[str, int, int], bool]:
    """Returns the callback of a publication."""

    def show(stage: str, done: int, total: int) -> bool:
        if progress is not None:
            progress(f"publishing {stage}", done, total)
        return True

    return show
