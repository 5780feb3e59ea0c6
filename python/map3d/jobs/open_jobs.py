"""The jobs of a rendering that are still to do."""

from map3d.catalogue import Catalogue
from map3d.catalogue.states import OPEN


def count_open(catalogue: Catalogue, rendering: str) -> int:
    """Returns the number of jobs that are neither done nor ended in another way."""
    counts = catalogue.count_jobs(rendering)
    return sum(counts[state] for state in OPEN)


def has_jobs_left(catalogue: Catalogue, rendering: str) -> bool:
    """Returns whether any job is todo or leased, or can be opened.

    Sweeps before it says no: another process may be between the end of a job and the opening of the job above, or may have been killed there. Looks
    once more after the sweep, since that process may have opened the job meanwhile.
    """
    return catalogue.has_open_jobs(rendering) or catalogue.sweep(rendering) > 0 or catalogue.has_open_jobs(rendering)
