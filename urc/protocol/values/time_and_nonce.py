"""Times and nonces for sent frames.

Pure. The sources of times and nonces are passed in: a clock and a random generator for a robot, and
fixed sources for tests. With fixed sources, a document's frames always have the same bytes.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

from urc.expressions import NONCE, NOW

__all__ = ["FIXED", "FIXED_UNIX_S", "TimeAndNonce", "fixed_bytes"]

FIXED_UNIX_S: Final = 946684800.0
"""2000-01-01T00:00:00Z."""


class TimeAndNonce(NamedTuple):
    """Sources of times and nonces."""

    unix_s: Callable[[], float]
    """Function that returns the Unix time, in seconds."""
    random: Callable[[int], bytes]
    """Function that returns a given number of random bytes, different at each call."""

    def names(self) -> dict[str, object]:
        """Return the namespace for one frame; all its expressions get the same time and nonce."""
        made: dict[int, bytes] = {}

        def nonce(size: int) -> bytes:
            if size not in made:
                made[size] = self.random(size)
            return made[size]

        return {NOW: self.unix_s(), NONCE: nonce}


def fixed_bytes(size: int) -> bytes:
    """Return the bytes 00 01 02 …, for tests."""
    return bytes(range(size))


FIXED: Final = TimeAndNonce(lambda: FIXED_UNIX_S, fixed_bytes)
"""Fixed sources of times and nonces, for tests."""
