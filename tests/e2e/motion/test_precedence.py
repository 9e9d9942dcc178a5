"""The real system's part in letting the guard run before others."""

import subprocess
import sys

import pytest

pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif(sys.platform != "linux", reason="other systems have none of it"),
]

TIMEOUT_S = 60
PROGRAM = """
import os
from urc.guard.real_time_priority import RealTimePriority
refusal = RealTimePriority().request()
ordinary = os.SCHED_OTHER
reset = os.SCHED_RESET_ON_FORK
print(refusal or "granted", flush=True)
before = os.sched_getscheduler(0) & ~reset
turns = 0
while os.sched_getscheduler(0) & ~reset != ordinary:
    turns += 1
print("ordinary" if refusal else f"from {before == os.SCHED_RR} to ordinary", turns > 0)
"""


def test_a_guard_that_never_waits_becomes_a_program_like_others() -> None:
    """Where it is granted: the kernel says that it is too long, long before it ends it."""
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    told, became = done.stdout.splitlines()
    granted = (told, became) == ("granted", "from True to ordinary True")
    assert granted or became == "ordinary False", done.stdout
