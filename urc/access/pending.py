"""Sign-ins that wait for their second request: each one works once, and only for a short time.

Layer 4. Pure. A passkey answers a challenge of the server, and an OpenID Connect provider sends the
browser back with a state. The limits bound the memory that unknown visitors can take.
"""

import ipaddress
import secrets
from collections import OrderedDict
from typing import Final, Generic, NamedTuple, TypeVar

__all__ = ["MOST_PENDING", "MOST_PENDING_HERE", "Pending", "place_of"]

MOST_PENDING: Final = 2048
"""Most pending sign-ins; a new one replaces the oldest."""
MOST_PENDING_HERE: Final = 16
"""Most pending sign-ins of one place; a new one replaces the oldest of the same place."""
_SUBNET: Final = 64

_Value = TypeVar("_Value")


class _Entry(NamedTuple, Generic[_Value]):
    value: _Value
    place: str
    ends_at: float


class Pending(Generic[_Value]):
    """Values by random keys of 256 bits."""

    def __init__(self, lasts_s: float) -> None:
        """Begin empty.

        Args:
            lasts_s: time after which a key is invalid, in seconds.
        """
        self._lasts_s = lasts_s
        self._entries: OrderedDict[str, _Entry[_Value]] = OrderedDict()

    def __len__(self) -> int:
        """Return the number of keys, including those whose time has run out."""
        return len(self._entries)

    def begin(self, value: _Value, place: str, now: float) -> str:
        """Keep a value and return its key.

        Args:
            value: the value, which the key returns once.
            place: network address of the visitor.
            now: monotonic time in seconds.
        """
        place = place_of(place)
        self._forget_old(now)
        # A place at its limit loses its own oldest key, never that of another place.
        here = [key for key, entry in self._entries.items() if entry.place == place]
        if len(here) >= MOST_PENDING_HERE:
            del self._entries[here[0]]
        elif len(self._entries) >= MOST_PENDING:
            self._entries.popitem(last=False)
        key = secrets.token_urlsafe(32)
        self._entries[key] = _Entry(value, place, now + self._lasts_s)
        return key

    def finish(self, key: str, now: float) -> _Value | None:
        """Return the value of a key and end the key; None for an unknown or late key."""
        self._forget_old(now)
        entry = self._entries.pop(key, None)
        return entry.value if entry else None

    def _forget_old(self, now: float) -> None:
        # All keys last equally long, so the oldest ones are first.
        while self._entries and next(iter(self._entries.values())).ends_at <= now:
            self._entries.popitem(last=False)


def place_of(address: str) -> str:
    """Return the part of an address by which visitors are counted.

    One device chooses among 2⁶⁴ addresses of its IPv6 network, so the network counts.
    """
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv4Address):
        return str(parsed)
    if parsed.ipv4_mapped is not None:
        return str(parsed.ipv4_mapped)
    return str(ipaddress.IPv6Network((int(parsed), _SUBNET), strict=False))
