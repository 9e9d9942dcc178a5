"""Log lines about refused sites, without floods.

Layer 5.
"""

import logging
import time
from collections.abc import Callable
from math import inf
from typing import Final

from urc.problems import printable

__all__ = ["RefusalLog"]

AGAIN_S: Final = 60.0
"""Time after which the same refusal is logged again, in seconds."""
_MOST: Final = 256

log = logging.getLogger(__name__)


class RefusalLog:
    """Logs why other sites are refused."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Have logged nothing yet; `clock` returns a time in seconds."""
        self._clock = clock
        self._told: dict[tuple[str, str, str], float] = {}

    def tell(self, what: str, site: str, reason: str) -> None:
        """Log a refusal, unless the same one was logged within `AGAIN_S`.

        Args:
            what: the refused thing, such as ``a line``.
            site: the site's name, which may be a mere claim.
            reason: why it is refused, in one line.
        """
        key, now_s = (what, site, reason), self._clock()
        if now_s - self._told.get(key, -inf) < AGAIN_S:
            return
        if len(self._told) >= _MOST:
            self._told.clear()
        self._told[key] = now_s
        log.warning("%s of the site %s is refused: %s", what, printable(site), reason)
