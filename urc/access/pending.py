"""Pending sign-ins, which wait some minutes for their second request and can be used only once.

Layer 4. Pure. A passkey signs a challenge from the server. An OpenID Connect provider sends the
browser back with a state from the server. The limits bound the memory that visitors who have not
signed in can occupy.
"""

import ipaddress
import secrets
from collections import OrderedDict
from typing import Final, Generic, NamedTuple, TypeVar

__all__ = ["MOST_PENDING", "MOST_PENDING_HERE", "Pending", "place_of"]

MOST_PENDING: Final = 2048
"""Maximum number of pending sign-ins; above the limit, the oldest is dropped."""
MOST_PENDING_HERE: Final = 16
"""Maximum number of pending sign-ins per place; above the limit, that place's oldest is dropped."""
_SUBNET: Final = 64

_Value = TypeVar("_Value")


class _Entry(NamedTuple, Generic[_Value]):
    value: _Value
    place: str
    ends_at: float


class Pending(Generic[_Value]):
    """Values stored under random 256-bit keys; each value can be retrieved once."""

    def __init__(self, lasts_s: float) -> None:
        """Initialize without values.

        Args:
            lasts_s: validity of a key, in seconds.
        """
        self._lasts_s = lasts_s
        self._entries: OrderedDict[str, _Entry[_Value]] = OrderedDict()

    def __len__(self) -> int:
        """Return the number of keys, including expired keys."""
        return len(self._entries)

    def begin(self, value: _Value, place: str, now: float) -> str:
        """Store a value, and return the random key with which it can be retrieved.

        Args:
            value: the value, which can be retrieved once.
            place: the visitor's network address.
            now: monotonic time in seconds.
        """
        place = place_of(place)
        self._forget_old(now)
        # At its limit, a place loses its own oldest key, never another place's key.
        here = [key for key, entry in self._entries.items() if entry.place == place]
        if len(here) >= MOST_PENDING_HERE:
            del self._entries[here[0]]
        elif len(self._entries) >= MOST_PENDING:
            self._entries.popitem(last=False)
        key = secrets.token_urlsafe(32)
        self._entries[key] = _Entry(value, place, now + self._lasts_s)
        return key

    def finish(self, key: str, now: float) -> _Value | None:
        """Return a key's value and delete the key; None for an unknown or expired key."""
        self._forget_old(now)
        entry = self._entries.pop(key, None)
        return entry.value if entry else None

    def _forget_old(self, now: float) -> None:
        # All keys have the same validity, so the oldest keys come first.
        while self._entries and next(iter(self._entries.values())).ends_at <= now:
            self._entries.popitem(last=False)


def place_of(address: str) -> str:
    """Return the part of a visitor's address to which the limits apply.

    A device can use any of the 2⁶⁴ addresses in its IPv6 network, so the limit applies to the
    network.
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
