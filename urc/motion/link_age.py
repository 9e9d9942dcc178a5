"""The age of input from another site, and how it limits a held command.

Theory of operation. A tick passes through the page's own server and the network between the sites.
The robot's site sends numbered heartbeats the same way back, and each tick echoes the newest one.
The time between a heartbeat and its echo is a round trip, measured at the robot's site alone. No
clocks of two machines are compared, and the page states no age.

A round trip also contains the way to the page. This way is estimated as half of the page's smallest
round trip so far, at most `LONGEST_WAY_S`. Every further delay counts as age. A page that echoes an
old heartbeat only makes its ticks older. No tick moves the robot at an age above the sum of
`TOO_OLD_S` and `LONGEST_WAY_S`, even if only the way from the page is slow.
"""

import math
from typing import Final, NamedTuple

from urc.motion.driving_lock import Permit, permit_between

__all__ = ["FULL_SPEED_S", "LONGEST_WAY_S", "TOO_OLD_S", "LinkAge", "LinkState", "link_permit"]

FULL_SPEED_S: Final = 0.15
"""Maximum age at which a tick from another site moves the robot at the requested speed, in seconds.
Above this age, the permitted speed falls linearly."""
TOO_OLD_S: Final = 0.5
"""Maximum age of a tick from another site, in seconds. At this age, the robot stops."""
LONGEST_WAY_S: Final = 0.15
"""Maximum time for the way to a page of another site that does not count as age, in seconds."""
SHOWN_S: Final = 0.5
"""Time for which the page shows the age of its last tick, in seconds."""


class LinkState(NamedTuple):
    """The state of a link from another site, as the page shows it."""

    age_s: float
    """Age of the newest tick at its arrival, in seconds."""
    share: float
    """Permitted share of the requested speed, from 0 to 1."""


class LinkAge:
    """The ages of the ticks from one page of another site."""

    def __init__(self) -> None:
        self._shortest_s = math.inf
        self._newest_s = 0.0
        self._at_s = -math.inf

    def measure(self, round_trip_s: float, now: float) -> float:
        """Return the age of a tick at its arrival, in seconds.

        Args:
            round_trip_s: time from the heartbeat that the tick echoes to the tick's arrival.
            now: time of the arrival.
        """
        self._shortest_s = min(self._shortest_s, round_trip_s)
        self._newest_s = round_trip_s - min(self._shortest_s / 2, LONGEST_WAY_S)
        self._at_s = now
        return self._newest_s

    @property
    def permit(self) -> Permit:
        """The motion that the newest tick permits."""
        return link_permit(self._newest_s)

    def state(self, now: float) -> LinkState | None:
        """Return the state of the link; None if no tick arrived in the last `SHOWN_S` seconds."""
        if now - self._at_s > SHOWN_S:
            return None
        return LinkState(self._newest_s, self.permit.share)


def link_permit(age_s: float) -> Permit:
    """Return the motion that a tick from another site with the age `age_s` permits."""
    return permit_between(age_s, FULL_SPEED_S, TOO_OLD_S)
