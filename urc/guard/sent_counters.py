"""The counters of one connection, as the frames say that have left.

The guard knows no template: it is given frames with their numbers in them, and what they do to the
counters. A frame leaves only while its numbers are the next ones, so numbers on the wire are
gapless and rise, whatever was rendered in advance, and in whatever order it came here.
"""

from collections.abc import Sequence

from urc.model.payload import Count, Numbered

__all__ = ["SentCounters"]


class SentCounters:
    """Of one line. To be begun with each connection."""

    def __init__(self) -> None:
        self.stand: dict[str, int] = {}
        """Counter → the last number that has left; none: not used so far."""
        self.is_changed = False
        """Whether numbers have left that the engine was not told of."""

    def reset(self) -> None:
        """Begin anew: no number has left."""
        self.stand = {}
        self.is_changed = False

    def fits(self, count: Count | None) -> bool:
        """Return whether a frame may leave now; one without numbers always may."""
        if count is None:
            return True
        stand, before = self.stand, count.before
        return all(stand.get(name) == before.get(name) for name in count.after)

    def left(self, count: Count | None) -> None:
        """Take note that a frame has left."""
        if count is not None and count.after:
            self.stand = {**self.stand, **count.after}
            self.is_changed = True

    def choose(self, stops: Sequence[Numbered]) -> Numbered:
        """Return the stop whose turn it is. A stop with a wrong number is better than none."""
        return next((one for one in stops if self.fits(one.takes)), stops[-1])
