"""What a busy machine does to a gesture, taken out of the tests that are not about it.

Server, robot, test and browser share a few cores here, with other tests. Each of them may be kept
from running for half a second; then the server stops what moves, as it should, and says so. Unit
tests with a clock of their own show that, and tests/e2e/motion with servers that are processes. A
server in the test's own loop has limits that no pause reaches; a lease ends a gesture all the same.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

__all__ = ["LONGEST_S", "unhurried"]

LONGEST_S = 120.0
"""As long as a test may take."""
BEATS = 4000
"""So many of them are remembered: as many as there are in that time, and more."""


@contextmanager
def unhurried() -> Iterator[None]:
    """Give servers in this process all the time there is."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("urc.motion.hold_to_run.LONGEST_LEASE_S", LONGEST_S)
        patched.setattr("urc.motion.freshness.OLDEST_S", LONGEST_S)
        patched.setattr("urc.client.remote_motion.OLDEST_S", LONGEST_S)
        patched.setattr("urc.motion.link_age.FULL_SPEED_S", LONGEST_S)
        patched.setattr("urc.motion.link_age.TOO_OLD_S", 2 * LONGEST_S)
        patched.setattr("urc.motion.freshness._KEPT", BEATS)
        patched.setattr("urc.web.drive.control_service.TOO_LATE_S", LONGEST_S)
        yield
