"""Limits on one visitor's commands over the HTTP API.

Layer 5. Pure. STOP is never limited.
"""

from collections import Counter, OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from urc.web.feed.client_socket import TokenBucket
from urc.web.serve.replies import ApiError

__all__ = ["AT_ONCE", "MOST_VISITORS", "REQUESTS_PER_S", "RequestLimits"]

REQUESTS_PER_S: Final = 200
"""Maximum number of one visitor's commands, lease requests and motion requests per second."""
AT_ONCE: Final = 16
"""Maximum number of one visitor's running commands."""
MOST_VISITORS: Final = 1024
"""Maximum number of stored visitor rates; above this number, the least recently used rate is
dropped."""


class RequestLimits:
    """Limits the request rate and the running commands of each visitor."""

    def __init__(self) -> None:
        self._rates: OrderedDict[str, TokenBucket] = OrderedDict()
        self._running: Counter[str] = Counter()

    def count(self, who: str, now_s: float) -> None:
        """Count a request from `who`; raise `ApiError` 429 above the maximum rate."""
        bucket = self._rates.pop(who, None) or TokenBucket(REQUESTS_PER_S, now_s)
        self._rates[who] = bucket  # reinserted at the end, so the first entry is the least recent
        while len(self._rates) > MOST_VISITORS:
            self._rates.popitem(last=False)
        if not bucket.allow(now_s):
            raise ApiError(429, f"more than {REQUESTS_PER_S} requests a second", "too-many")

    @contextmanager
    def running(self, who: str) -> Iterator[None]:
        """Count a running command while the context is open; raise `ApiError` 429 at the limit."""
        if self._running[who] >= AT_ONCE:
            raise ApiError(429, f"{AT_ONCE} commands are still running", "busy")
        self._running[who] += 1
        try:
            yield
        finally:
            self._running[who] -= 1
            if not self._running[who]:
                del self._running[who]
