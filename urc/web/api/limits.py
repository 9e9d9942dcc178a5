"""Limits on the commands of one visitor of the HTTP API.

Layer 5. Pure. STOP is never limited here.
"""

from collections import Counter, OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from urc.web.feed.client_socket import TokenBucket
from urc.web.serve.replies import ApiError

__all__ = ["AT_ONCE", "MOST_VISITORS", "REQUESTS_PER_S", "RequestLimits"]

REQUESTS_PER_S: Final = 200
"""Maximum rate of commands, lease requests and motion requests of one visitor, as a page's."""
AT_ONCE: Final = 16
"""Maximum number of running commands of one visitor."""
MOST_VISITORS: Final = 1024
"""Maximum number of visitors with a rate; the least recent one is forgotten."""


class RequestLimits:
    """The rates and running commands of all visitors."""

    def __init__(self) -> None:
        self._rates: OrderedDict[str, TokenBucket] = OrderedDict()
        self._running: Counter[str] = Counter()

    def count(self, who: str, now_s: float) -> None:
        """Count a request of `who`; raise `ApiError` 429 above the rate."""
        bucket = self._rates.pop(who, None) or TokenBucket(REQUESTS_PER_S, now_s)
        self._rates[who] = bucket  # at the end: the first rate is the least recent one
        while len(self._rates) > MOST_VISITORS:
            self._rates.popitem(last=False)
        if not bucket.allow(now_s):
            raise ApiError(429, f"more than {REQUESTS_PER_S} requests a second", "too-many")

    @contextmanager
    def running(self, who: str) -> Iterator[None]:
        """Count a running command in the context; raise `ApiError` 429 at the limit."""
        if self._running[who] >= AT_ONCE:
            raise ApiError(429, f"{AT_ONCE} commands are still running", "busy")
        self._running[who] += 1
        try:
            yield
        finally:
            self._running[who] -= 1
            if not self._running[who]:
                del self._running[who]
