"""The timeouts and retry limits of workers."""

from dataclasses import dataclass

from map3d.catalogue import HEARTBEAT_S


@dataclass(frozen=True)
class Timeouts:
    heartbeat_s: float = HEARTBEAT_S
    """Interval between two renewals of a lease."""
    block_s: float = 900.0
    """A subprocess that works longer on one block counts as hung."""
    start_s: float = 120.0
    """The longest time that a subprocess may take to start."""
    idle_s: float = 0.5
    """How often a worker without a job polls for one."""
    tick_s: float = 0.25
    """How often a busy worker checks whether to stop."""
    wait_s: float = 3.0
    """When all workers have been idle this long, the user is informed."""
    count_s: float = 2.0
    """How often a run counts the remaining jobs, which other runs may do too."""
    plan_s: float = 1.0
    """First pause of a process that waits for a new plan; doubled up to `longest_pause_s`."""
    poll_s: float = 2.0
    """How often `map3d work --forever` looks for renderings with open jobs."""
    longest_pause_s: float = 30.0
    failures: int = 3
    """A worker exits when this many different jobs have failed."""
    starts: int = 12
    """A worker exits when this many subprocesses in a row died before they were ready."""
    start_pause_s: float = 0.25
    """Pause before the next start, times the number of attempts so far."""
