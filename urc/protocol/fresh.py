"""What is new in each frame: the time of day, and bytes that nobody can foresee.

Floor 3, pure. Both come from sources that are given: a clock and a generator for a robot, fixed
ones for tests, so that the same document gives the same frames.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

from urc.expressions import NONCE, NOW

__all__ = ["FIXED", "FIXED_UNIX_S", "Fresh", "fixed_bytes"]

FIXED_UNIX_S: Final = 946684800.0
"""2000-01-01T00:00:00Z."""


class Fresh(NamedTuple):
    """The sources of time and randomness."""

    unix_s: Callable[[], float]
    """Seconds since 1970, UTC."""
    random: Callable[[int], bytes]
    """So many bytes, never the same twice."""

    def names(self) -> dict[str, object]:
        """Return what the templates of one frame know: asked twice, it is the same."""
        made: dict[int, bytes] = {}

        def nonce(size: int) -> bytes:
            if size not in made:
                made[size] = self.random(size)
            return made[size]

        return {NOW: self.unix_s(), NONCE: nonce}


def fixed_bytes(size: int) -> bytes:
    """Return 00 01 02 …, for tests."""
    return bytes(range(size))


FIXED: Final = Fresh(lambda: FIXED_UNIX_S, fixed_bytes)
"""For tests of frames."""
