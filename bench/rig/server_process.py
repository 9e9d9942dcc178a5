"""A real ``urc serve`` that a signal can block: a separate program.

``python -m bench.rig.server_process serve …`` starts the server. On SIGUSR2, the main thread
matches a pattern that takes twice as long for each additional letter. The interpreter is blocked
during the match. The program then prints::

    backtracked TIME TIME   from when to when, monotonic nanoseconds
"""

import re
import signal
import sys
import time
from types import FrameType

from urc.cli.main import main

HELD_UP_NS = 800_000_000
"""Duration of the block in seconds, longer than every lease in the rig and the age limit for
inputs."""
FIRST_LETTERS = 20


def backtrack(number: int, frame: FrameType | None) -> None:
    """Block the process."""
    began_ns = time.monotonic_ns()
    letters = FIRST_LETTERS
    while time.monotonic_ns() - began_ns < HELD_UP_NS:
        re.match("^(a+)+$", "a" * letters + "!")
        letters += 1
    sys.stdout.write(f"backtracked {began_ns} {time.monotonic_ns()}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    signal.signal(signal.SIGUSR2, backtrack)
    sys.exit(main())
