"""Data that a driven robot's program receives after it was frozen for 5 s.

SIGSTOP and SIGCONT freeze and resume a substitute for rosbridge, while the kernel continues to
accept data for it.
"""

from collections.abc import Sequence

from bench.harness import Result
from bench.troubles import measured

__all__ = ["run"]

TITLE = "motion after {} freezes of the robot's program"
TRIALS, TRIALS_IF_FULL = 4, 100
ROBOTS, ROBOTS_IF_FULL = 2, 10


def run(*, full: bool) -> Sequence[Result]:
    """Freeze programs until enough trials are valid."""
    wanted, robot_count = (TRIALS_IF_FULL, ROBOTS_IF_FULL) if full else (TRIALS, ROBOTS)
    return [measured("motion_freeze", TITLE, wanted, robot_count=robot_count)]
