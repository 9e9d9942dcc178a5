"""The images that a robot's held commands require the operator to see, and the override.

Pure: callers pass the current time. `urc.motion.driving_lock` contains the rule.
"""

from collections.abc import Mapping
from typing import Final

from urc.model.driver import Command
from urc.model.exchange import Sight
from urc.motion.driving_lock import BLIND_S, Permit, permit_of
from urc.motion.lease import LeaseState

__all__ = ["LONGEST_OVERRIDE_S", "NO_IMAGE", "OLD_IMAGE", "ImageInterlock", "why_blind"]

NO_IMAGE: Final = "No current image of the camera"
OLD_IMAGE: Final = "Image too old: let go, then start again"
_NEEDS_NONE: Final = "no command of this robot requires an image"
SHORTEST_OVERRIDE_S: Final = 1.0
LONGEST_OVERRIDE_S: Final = 30.0
"""Longest time for which an operator may drive without an image, in seconds."""


class ImageInterlock:
    """Decides what motion an image permits, and keeps the operator's override."""

    def __init__(self, commands: Mapping[str, Command]) -> None:
        """Create the interlock of the held commands among `commands`, without an override."""
        self._sights: dict[str, Sight] = {
            name: one.hold.sight
            for name, one in commands.items()
            if one.hold is not None and one.hold.sight is not None
        }
        self._client = ""
        self._until_s = 0.0

    @property
    def signals(self) -> frozenset[str]:
        """Signals whose images the operator must see to use some held command."""
        return frozenset(sight.signal for sight in self._sights.values())

    def signal_of(self, command: str) -> str:
        """Return the signal that the operator must see to use a command; "" if none."""
        sight = self._sights.get(command)
        return "" if sight is None else sight.signal

    def permit(self, command: str, client: str, age_s: float, now: float) -> Permit | None:
        """Return the motion that the operator's image permits; None if none is required.

        Args:
            command: the held command.
            client: the page that drives.
            age_s: age of the image on the page, in seconds; `BLIND_S` without an image.
            now: the current time.
        """
        sight = self._sights.get(command)
        if sight is None:
            return None
        permit, left_s = permit_of(sight, age_s), self._until_s - now
        if client != self._client or left_s <= 0:
            return permit
        return Permit(1.0, max(left_s, permit.for_s))

    def override(self, client: str, for_s: float, now: float) -> str:
        """Permit `client` to drive without an image; return why not, or "".

        The time is limited to between 1 s and `LONGEST_OVERRIDE_S`. A new override replaces the
        previous one.
        """
        if not self._sights:
            return _NEEDS_NONE
        for_s = min(max(for_s, SHORTEST_OVERRIDE_S), LONGEST_OVERRIDE_S)
        self._client, self._until_s = client, now + for_s
        return ""

    def override_s(self, now: float) -> float:
        """Return how long the override still lasts, in seconds; 0 without an override."""
        return max(0.0, self._until_s - now) if self._client else 0.0

    def lease_changed(self, state: LeaseState) -> None:
        """End the override, unless the operator who made it still holds the lease."""
        if state.holder is None or state.holder.id != self._client:
            self._client = ""


def why_blind(age_s: float, *, is_moving: bool) -> str:
    """Return the reason why an image of the age `age_s` ends or prevents a motion."""
    return OLD_IMAGE if is_moving or age_s < BLIND_S else NO_IMAGE
