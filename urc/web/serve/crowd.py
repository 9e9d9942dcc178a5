"""How much one visitor may have under way: a crowd from one place leaves room for the others.

Floor 5. Pure. Holders of a key are counted one by one, strangers by their address. STOP is not
counted: it always has a place.
"""

import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from urc.web.serve.access import Visitor

__all__ = ["KNOWN_PLACES", "PLACES", "Places", "is_stop"]

PLACES = 32
"""Requests and sockets of one stranger's address at a time. A page has one or two sockets and up
to six requests: enough for several pages, and for a few people behind one address."""
KNOWN_PLACES = 256
"""Of one browser or program that is known: it may watch many robots."""

_STOP = re.compile(r"/api/v1/robots/[^/ ]+/stop")


def is_stop(method: str, path: str) -> bool:
    """Return whether a request stops a robot."""
    return method == "POST" and _STOP.fullmatch(path) is not None


class Places:
    """Who has how much under way."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._taken: Counter[str] = Counter()

    @contextmanager
    def taken(self, visitor: Visitor, address: str) -> Iterator[bool]:
        """Take a place for as long as the context lasts; give whether there was one.

        Args:
            visitor: who asks.
            address: from where, for strangers.
        """
        is_known = visitor.standing != "stranger"
        who = f"{visitor.standing} {visitor.name}" if is_known else f"at {address}"
        if self._taken[who] >= (KNOWN_PLACES if is_known else PLACES):
            yield False
            return
        self._taken[who] += 1
        try:
            yield True
        finally:
            self._taken[who] -= 1
            if not self._taken[who]:
                del self._taken[who]
