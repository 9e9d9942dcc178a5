"""A page as the motion controller sees it: its operator, and the freshness of its input."""

from secrets import randbelow
from typing import Final

from urc.motion.driving_lock import Permit
from urc.motion.freshness import Freshness
from urc.motion.lease import Operator
from urc.motion.link_age import LinkAge
from urc.runtime.image_interlock import OLD_IMAGE

__all__ = ["SLOW_LINK", "MotionScreen"]

SLOW_LINK: Final = "Slow link: let go, then start again"
_FIRST_TICKS: Final = 2**31


class MotionScreen:
    """One page."""

    __slots__ = ("client", "freshness")

    def __init__(self, client: Operator) -> None:
        """Start before the first heartbeat; the link of an operator of another site is measured."""
        self.client = client
        link = LinkAge() if client.way == "site" else None
        self.freshness = Freshness(randbelow(_FIRST_TICKS) + 1, link)

    def limit(self, seen: Permit | None, lease_s: float) -> tuple[Permit | None, str]:
        """Return what image and link permit, and the reason for a shortened lease.

        Args:
            seen: what the operator's image permits; None if the command needs no image.
            lease_s: the lease of the command, in seconds.

        Returns:
            The permit, or None for motion without limits. The reason is "" if the permit lasts at
            least as long as the lease.
        """
        link = self.freshness.link
        if link is None:
            return seen, OLD_IMAGE if seen is not None and seen.for_s < lease_s else ""
        both, why = link.permit, SLOW_LINK
        if seen is not None:
            why = SLOW_LINK if both.for_s < seen.for_s else OLD_IMAGE
            both = Permit(min(both.share, seen.share), min(both.for_s, seen.for_s))
        return both, why if both.for_s < lease_s else ""
