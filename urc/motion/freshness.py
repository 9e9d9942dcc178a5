"""Is an input fresh? Without trusting anybody's clock.

The server numbers its own ticks and tells them to every page; an input echoes the newest number
that its page has seen, the epoch of its lease, and counts itself. So one that lay in a buffer, was
recorded and played back, or belongs to an earlier lease is refused, however the clocks stand.
"""

from collections import deque
from typing import Final, NamedTuple

__all__ = ["OLDEST_S", "DuplicateElimination", "Freshness", "ControlInput"]

OLDEST_S: Final = 0.4
"""An input that echoes an older tick is refused."""
_KEPT: Final = 64


class ControlInput(NamedTuple):
    """What a page sends with every tick of a held control."""

    epoch: int
    """Of the lease."""
    number: int
    """Counts up with every tick of this page."""
    echo: int
    """Newest tick of the server that the page has seen."""


class Freshness:
    """The server's ticks, and the newest input of one page."""

    def __init__(self, first: int = 1) -> None:
        """Begin with nothing issued.

        Args:
            first: number of the first tick; one that nobody can guess refuses what was recorded
                before a restart.
        """
        self._issued: deque[float] = deque(maxlen=_KEPT)
        """When the newest numbers were issued: each is one more than that before it."""
        self._number = first - 1
        self._newest: dict[str, int] = {}

    def issue(self, now: float) -> int:
        """Return the number of a tick that is told to the page now."""
        self._number += 1
        self._issued.append(now)
        return self._number

    def refusal(self, given: ControlInput, epoch: int, now: float, of: str = "") -> str:
        """Return why an input is not taken, or "" and remember it.

        Args:
            given: what the page sent with it.
            epoch: of the lease that holds now.
            now: the time.
            of: the control: the inputs of one may overtake those of another.
        """
        if given.epoch != epoch:
            return f"it belongs to lease {given.epoch}, and this is {epoch}"
        if given.number <= self._newest.get(of, -1):
            return "it is not newer than the last one"
        back = self._number - given.echo
        if not 0 <= back < len(self._issued):
            return "it answers no tick of this server"
        issued_at = self._issued[-1 - back]
        if now - issued_at > OLDEST_S:
            return f"it is {(now - issued_at) * 1000:.0f} ms old"
        self._newest[of] = given.number
        return ""


class DuplicateElimination:
    """What a page says twice, on two lines that lose packets independently: the first counts.

    Its numbers only grow, and each line keeps their order. So what has a number that is not above
    the newest was said on the other line already, or was overtaken there by something newer: a tick
    that was held up must not move what the other line has let go of since.
    """

    def __init__(self) -> None:
        self._newest: dict[str, int] = {}

    def accept(self, about: str, number: int) -> bool:
        """Return whether `number` is above all that came about the same, and remember it."""
        if number <= self._newest.get(about, 0):
            return False
        self._newest[about] = number
        return True
