"""Lifetimes of sign-ins, codes and links.

Layer 4. Pure. The creator of a guest link or token chooses when it ends.
"""

from typing import Final, NamedTuple

__all__ = ["DEVICE", "INVITATION_S", "LONGEST_GUEST_S", "PAIRING_S", "PERSON", "Lifetime"]

_DAY_S: Final = 24 * 3600.0


class Lifetime(NamedTuple):
    """Time limits for one kind of sign-in: in total, and without use."""

    longest_s: float | None
    """Maximum duration, in seconds; None for no limit."""
    idle_s: float | None
    """Maximum time without use, in seconds; None for no limit."""

    def ends_at(self, now: float) -> float | None:
        """Return the latest UTC end time of a sign-in that begins now; None for no limit."""
        return None if self.longest_s is None else now + self.longest_s


PERSON: Final = Lifetime(7 * _DAY_S, 12 * 3600.0)
"""Lifetime of a person's sign-in in a browser."""
DEVICE: Final = Lifetime(None, 90 * _DAY_S)
"""Lifetime of a paired device's key."""
PAIRING_S: Final = 120.0
"""Validity of a pairing code, in seconds."""
INVITATION_S: Final = _DAY_S
"""Validity of an invitation to choose a passphrase, in seconds."""
LONGEST_GUEST_S: Final = 30 * _DAY_S
"""Longest validity of a guest link, in seconds."""
