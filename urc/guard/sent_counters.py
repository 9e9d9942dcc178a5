"""The counter values that were sent on one connection.

The guard has no templates. The guard gets rendered frames, each with its effect on the counters. A
frame is sent only while its values are the next ones. So the values on the wire rise without gaps,
in any order of arrival here, and regardless of frames that were rendered in advance.
"""

from collections.abc import Sequence

from urc.model.payload import Count, Numbered

__all__ = ["SentCounters"]


class SentCounters:
    """The sent counters of one line; `begin` starts each connection."""

    def __init__(self) -> None:
        self.stand: dict[str, int] = {}
        """Counter → last value sent; missing before the first one."""
        self.is_changed = False
        """Whether values were sent that the engine does not know yet."""

    def reset(self) -> None:
        """Start a connection, on which no value was sent."""
        self.stand = {}
        self.is_changed = False

    def fits(self, count: Count | None) -> bool:
        """Return whether a frame may be sent now; a frame without counters always may."""
        if count is None:
            return True
        stand, before = self.stand, count.before
        return all(stand.get(name) == before.get(name) for name in count.after)

    def left(self, count: Count | None) -> None:
        """Record a sent frame."""
        if count is not None and count.after:
            self.stand = {**self.stand, **count.after}
            self.is_changed = True

    def choose(self, stops: Sequence[Numbered]) -> Numbered:
        """Return the stop with the next values. A wrong value is better than no stop."""
        return next((one for one in stops if self.fits(one.takes)), stops[-1])
