"""Limits on each visitor's concurrent requests, so that other visitors can still connect.

Layer 5. Pure. Each person, device and program has a separate count; unknown visitors are
counted by address. STOP requests are not counted because they are always accepted.
"""

import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from urc.web.serve.visitor import Visitor

__all__ = ["KNOWN_PLACES", "PLACES", "ConnectionQuota", "is_stop"]

PLACES = 32
"""Maximum number of concurrent requests and sockets of all unknown visitors at one address. A page
uses up to three sockets and six requests, so the limit permits several pages and a few people
behind one address."""
KNOWN_PLACES = 256
"""Maximum number of concurrent requests and sockets of one known person, device or program. The
limit is high, because a known visitor may watch many robots."""

_STOP = re.compile(r"/api/v1/(?:robots/[^/ ]+/)?stop|/fleet/stop")


def is_stop(method: str, path: str) -> bool:
    """Return whether a request stops robots."""
    return method == "POST" and _STOP.fullmatch(path) is not None


class ConnectionQuota:
    """Counters of concurrent requests, one for each visitor."""

    def __init__(self) -> None:
        """Start all counts at zero."""
        self._taken: Counter[str] = Counter()

    @contextmanager
    def taken(self, visitor: Visitor, address: str) -> Iterator[bool]:
        """Count a request while the context is open; yield whether the limit permits it.

        `address` identifies an unknown visitor.
        """
        who = visitor.client or f"at {address}"
        if self._taken[who] >= (KNOWN_PLACES if visitor.is_known else PLACES):
            yield False
            return
        self._taken[who] += 1
        try:
            yield True
        finally:
            self._taken[who] -= 1
            if not self._taken[who]:
                del self._taken[who]
