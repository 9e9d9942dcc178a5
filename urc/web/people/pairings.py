"""The administrators' pending pairings, one for each displayed code.

Layer 5. Pure. Like the store, this module keeps only the digests of the codes.
"""

import secrets
from collections import OrderedDict
from typing import Final

from urc.access.directory import digest_of
from urc.access.pairing import NewSignIn, check_number
from urc.web.people.messages import PairingState

__all__ = ["MOST_PAIRINGS", "Pairings"]

MOST_PAIRINGS: Final = 256
"""Maximum number of remembered pairings; above it, the oldest pairing is dropped."""


class _Pairing:
    __slots__ = ("begun", "digest", "ends_at")

    def __init__(self, digest: bytes, ends_at: float) -> None:
        self.digest = digest
        self.ends_at = ends_at
        self.begun: NewSignIn | None = None


class Pairings:
    """The newest pairings with their states."""

    def __init__(self) -> None:
        self._known: OrderedDict[str, _Pairing] = OrderedDict()

    def add(self, code: str, ends_at: float) -> str:
        """Add a pairing for the device with `code` and return the pairing's identifier.

        Args:
            code: the code.
            ends_at: UTC time at which the code expires, in seconds since 1970.
        """
        name = secrets.token_hex(8)
        self._known[name] = _Pairing(digest_of(code), ends_at)
        while len(self._known) > MOST_PAIRINGS:
            self._known.popitem(last=False)
        return name

    def paired(self, code: str, begun: NewSignIn) -> None:
        """Record the device that used `code`."""
        digest = digest_of(code)
        for one in self._known.values():
            if one.digest == digest:
                one.begun = begun

    def state(self, name: str, now: float) -> PairingState:
        """Return the state of a pairing; an unknown pairing has the state ``over``."""
        one = self._known.get(name)
        if one is not None and one.begun is not None:
            device = one.begun.principal
            return PairingState("paired", device.name, device.id, check_number(one.begun.sign_in))
        is_over = one is None or now >= one.ends_at
        return PairingState("over" if is_over else "waiting")
