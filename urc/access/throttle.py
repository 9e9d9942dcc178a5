"""The limit on failed attempts to sign in, to pair or to open a link.

Layer 4. Pure. Each address, and each name that is tried, has a bucket of attempts. After `FREE`
failures the wait doubles with each one, up to `LONGEST_S`. A success empties the bucket of the name
alone: an attacker with one valid account cannot clear an address. STOP is never throttled here.
"""

from collections import OrderedDict
from typing import Final, NamedTuple

__all__ = ["FREE", "LONGEST_S", "MOST", "Throttle"]

FREE: Final = 5
"""Failures without a wait."""
LONGEST_S: Final = 30.0
"""Longest wait between two attempts, in seconds."""
FORGET_S: Final = 900.0
"""Time after which failures are forgotten, in seconds."""
MOST: Final = 4096
"""Most buckets; the least recently used one is forgotten."""


class _Bucket(NamedTuple):
    failures: int
    at: float


class Throttle:
    """Failed attempts by address and by name."""

    def __init__(self) -> None:
        self._buckets: OrderedDict[str, _Bucket] = OrderedDict()

    def wait_s(self, now: float, *keys: str) -> float:
        """Return the time until the next attempt is allowed, in seconds; 0 if it is allowed now.

        Args:
            now: monotonic time in seconds.
            keys: keys of the attempt, such as its address and the name that is tried.
        """
        return max((self._wait_s(now, key) for key in keys), default=0.0)

    def failed(self, now: float, *keys: str) -> None:
        """Count a failure."""
        for key in keys:
            bucket = self._bucket(now, key)
            self._buckets[key] = _Bucket(bucket.failures + 1, now)
            self._buckets.move_to_end(key)
        # An attacker needs this many addresses before the failures of one are forgotten early.
        while len(self._buckets) > MOST:
            self._buckets.popitem(last=False)

    def succeeded(self, key: str) -> None:
        """Forget the failures of a name after its owner has signed in."""
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
        # 1, 2, 4, … s: a person who mistypes hardly waits, and a program guesses twice a minute.
        pause_s = min(LONGEST_S, 2.0 ** (bucket.failures - FREE))
        return max(0.0, bucket.at + pause_s - now)
