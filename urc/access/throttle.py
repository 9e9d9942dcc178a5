"""Rate limit for failed attempts to sign in, pair a device or open a link.

Layer 4. Pure. Each address and each attempted name has its own count of failures. After `FREE`
failures, each further failure doubles the wait, up to `LONGEST_S`. A success clears only the name's
count, so an attacker with one valid account cannot clear the address's count. This limit never
applies to STOP.
"""

from collections import OrderedDict
from typing import Final, NamedTuple

__all__ = ["FREE", "LONGEST_S", "MOST", "Throttle"]

FREE: Final = 5
"""Number of failures before the first wait."""
LONGEST_S: Final = 30.0
"""Longest wait between two attempts, in seconds."""
FORGET_S: Final = 900.0
"""Time after which failures are forgotten, in seconds."""
MOST: Final = 4096
"""Maximum number of counts; above the limit, the least recently used count is dropped."""


class _Bucket(NamedTuple):
    failures: int
    at: float


class Throttle:
    """Counts of failed attempts by address and by name."""

    def __init__(self) -> None:
        self._buckets: OrderedDict[str, _Bucket] = OrderedDict()

    def wait_s(self, now: float, *keys: str) -> float:
        """Return the time until the next permitted attempt, in seconds; 0 if permitted now.

        Args:
            now: monotonic time in seconds.
            keys: values that identify the attempt, such as its address and the attempted name.
        """
        return max((self._wait_s(now, key) for key in keys), default=0.0)

    def failed(self, now: float, *keys: str) -> None:
        """Count a failure."""
        for key in keys:
            bucket = self._bucket(now, key)
            self._buckets[key] = _Bucket(bucket.failures + 1, now)
            self._buckets.move_to_end(key)
        # To clear one address's failures early, an attacker would need this many addresses.
        while len(self._buckets) > MOST:
            self._buckets.popitem(last=False)

    def succeeded(self, key: str) -> None:
        """Forget a name's failures after its owner has signed in."""
        self._buckets.pop(key, None)

    def _bucket(self, now: float, key: str) -> _Bucket:
        bucket = self._buckets.get(key)
        if bucket is None or now - bucket.at >= FORGET_S:
            return _Bucket(0, now)
        return bucket

    def _wait_s(self, now: float, key: str) -> float:
        bucket = self._bucket(now, key)
        if bucket.failures < FREE:
            return 0.0
        # Waits of 1, 2, 4, … s hardly delay a person who mistypes, but limit a program to two
        # guesses a minute.
        pause_s = min(LONGEST_S, 2.0 ** (bucket.failures - FREE))
        return max(0.0, bucket.at + pause_s - now)
