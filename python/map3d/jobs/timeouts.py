"""The times and counts that workers keep to."""

from dataclasses import dataclass

from map3d.catalogue import HEARTBEAT_S


@dataclass(frozen=True)
class Terms:
    """`block_s`: how long a child may work on one block before it counts as hanging; `start_s`: how long it may take to start.

    A worker that fails `failures` different jobs leaves; so does one whose children die before they are ready `starts` times in a row, or say why
    they cannot start. A worker without a job looks again every `idle_s`, and every `tick_s` whether it is to stop. When all have had none for
    `wait_s`, the user is told.
    """

    heartbeat_s: float = HEARTBEAT_S
    block_s: float = 900.0
    start_s: float = 120.0
    idle_s: float = 0.5
    tick_s: float = 0.25
    wait_s: float = 3.0
    failures: int = 3
    starts: int = 12
    start_pause_s: float = 0.25
