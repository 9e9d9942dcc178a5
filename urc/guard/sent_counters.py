"""The counter values sent on one connection.

The guard evaluates no templates. Each rendered frame is therefore accompanied by the counter values
before and after it. A frame is sent only if its counter values are the next in order. The values on
the wire therefore increase without gaps, regardless of the order in which frames are rendered or
arrive.
"""

from collections.abc import Sequence

from urc.model.payload import Count, Numbered

__all__ = ["SentCounters"]


class SentCounters:
    """The counter values sent on one transport; `reset` prepares for a new connection."""

    def __init__(self) -> None:
        self.stand: dict[str, int] = {}
        """Last sent value of each counter, keyed by name; unsent counters are missing."""
        self.is_changed = False
        """Whether some sent values have not been reported to the engine yet."""

    def reset(self) -> None:
        """Prepare for a new connection, on which no counter value has been sent yet."""
        self.stand = {}
        self.is_changed = False

    def fits(self, count: Count | None) -> bool:
        """Return whether a frame may be sent now; always true for a frame without counters."""
        if count is None:
            return True
        stand, before = self.stand, count.before
        return all(stand.get(name) == before.get(name) for name in count.after)

    def left(self, count: Count | None) -> None:
        """Record the counter values of a sent frame."""
        if count is not None and count.after:
            self.stand = {**self.stand, **count.after}
            self.is_changed = True

    def choose(self, stops: Sequence[Numbered]) -> Numbered:
        """Return the stop frame that has the next counter values; if none has, the last one.

        A stop with a wrong counter value is better than no stop.
        """
        return next((one for one in stops if self.fits(one.takes)), stops[-1])
