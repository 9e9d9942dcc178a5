"""Lifetimes of sign-ins, codes and links.

Layer 4. Pure. A guest and a token end at the time that their maker chose.
"""

from typing import Final, NamedTuple

__all__ = ["DEVICE", "INVITATION_S", "LONGEST_GUEST_S", "PAIRING_S", "PERSON", "Lifetime"]

_DAY_S: Final = 24 * 3600.0


class Lifetime(NamedTuple):
    """Limits of one kind of sign-in."""

    longest_s: float | None
    """Longest life, in seconds; None: unlimited."""
    idle_s: float | None
    """Longest time without use, in seconds; None: unlimited."""

    def ends_at(self, now: float) -> float | None:
        """Return the latest end of a sign-in that begins now, as UTC time in seconds; or None."""
        return None if self.longest_s is None else now + self.longest_s


PERSON: Final = Lifetime(7 * _DAY_S, 12 * 3600.0)
"""The sign-in of a person in a browser."""
DEVICE: Final = Lifetime(None, 90 * _DAY_S)
"""The key of a paired device."""
PAIRING_S: Final = 120.0
"""Validity of a pairing code, in seconds."""
INVITATION_S: Final = _DAY_S
"""Validity of an invitation to choose a passphrase, in seconds."""
LONGEST_GUEST_S: Final = 30 * _DAY_S
"""Longest validity of a guest link, in seconds."""
